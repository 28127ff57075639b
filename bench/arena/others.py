"""Every solver of others that can enter, and those that cannot, with the reason."""

import peer_convex
import peer_mujoco
import peer_pinocchio
import peer_programs

OUTSIDE = {
    "ODE": "takes bodies under boxed friction, not matrices",
    "Drake (SAP)": "no wrapper here: its engine solves the contacts of its own models",
    "Newton (Kamino)": "no wrapper here: it takes Newton's model and contacts, not a problem as written here",
    "PhysX": "no wrapper here: it solves its own scenes, under its own law",
}


def entrants():
    yield from peer_programs.entrants()
    yield from peer_convex.entrants()
    yield from peer_mujoco.entrants()
    yield from peer_pinocchio.entrants()
