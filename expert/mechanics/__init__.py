"""Planar mechanics that solvers and checkers share: wrenches, friction cones, contacts with walls and support, reach."""

from expert.mechanics.contacts import ExternalContact, external_contacts, required_wrench
from expert.mechanics.reach import parking_place, region_rows, rho_limits, wall_rows, workspace
from expert.mechanics.wrenches import friction_rays, inertial_wrench, wrench_about

__all__ = [
    "ExternalContact",
    "external_contacts",
    "friction_rays",
    "inertial_wrench",
    "parking_place",
    "region_rows",
    "required_wrench",
    "rho_limits",
    "wall_rows",
    "workspace",
    "wrench_about",
]
