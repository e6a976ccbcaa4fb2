"""Use: a video file in, finger positions and forces out, with what comes of them in simulation."""

from dlm.infer.clip import Clip, read_clip
from dlm.infer.inference import Inference, Scene, infer
from dlm.infer.segmentation import Segmentation

__all__ = ["Clip", "Inference", "Scene", "Segmentation", "infer", "read_clip"]
