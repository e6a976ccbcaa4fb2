"""Use: a video file in, finger positions and forces out, with what comes of them in simulation."""

from dlm.infer.clip import Clip, VideoFile, read_clip
from dlm.infer.inference import Given, Inference, infer
from dlm.infer.segmentation import Segmentation

__all__ = ["Clip", "Given", "Inference", "Segmentation", "VideoFile", "infer", "read_clip"]
