"""Quiet standing: the arms hang, and the body sways by millimetres over feet that stay.

Forward and back the body rotates about the ankles, an inverted pendulum that the calf muscles hold
as a spring; sideways the hips move over both feet, and the trunk stays upright (D. A. Winter et
al., Stiffness control of balance in quiet standing, J. Neurophysiol. 80 (1998) 1211-1221). The
root, about the height of the centre of mass, moves by 4 mm (root mean square) forward and back and
by 2 mm sideways, as of healthy young adults with open eyes (T. E. Prieto et al., Measures of
postural steadiness, IEEE Trans. Biomed. Eng. 43 (1996) 956-966). The power spectral density is that
of noise through a low-pass of second order, 1 / (1 + (f / f0)^2)^2: most is slow drift, little is
above 1 Hz.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.motion.synthetic.figure import (
    ANKLE,
    HIP_Y,
    LEFT,
    ROOT,
    SIDES,
    Array,
    Pose,
    Subject,
    about,
    swing_arm,
    xyz,
)

FORWARD_M, SIDEWAYS_M = 0.004, 0.002
"""Root mean squares of the sway of the root, forward and back and sideways [m]."""

CORNER_HZ = 0.25
"""Frequency f0 of the spectrum, above which it falls with the fourth power."""

LEAN = math.radians(2.5)
"""Mean lean: the centre of mass is 4 cm ahead of the ankles."""

_TONES_HZ = np.geomspace(0.02, 2.0, 48)
"""Frequencies of the sway, in a geometric progression, so that it does not repeat."""

_PHASES = 2 * np.pi * np.outer([math.sqrt(2), math.sqrt(3)], np.arange(1, 49) ** 2)
"""Phases of the tones in both directions, without order (Weyl)."""

_LONGEST_S = 5000.0
"""Subjects and takes begin anywhere in this part of the same sway."""


def sway(t: Array, phases: Array) -> Array:
    """Sway (n,) of root mean square 1 in the long run, at times (n,) of tempo 1 [s]."""
    power = np.gradient(_TONES_HZ) / (1 + (_TONES_HZ / CORNER_HZ) ** 2) ** 2
    amplitudes = np.sqrt(2 * power / power.sum())
    turned = 2 * np.pi * np.multiply.outer(t, _TONES_HZ) + phases
    return np.asarray(np.cos(turned) @ amplitudes)


def stand(subject: Subject, t: Array) -> Pose:
    """Stand quietly, facing +x."""
    height = subject.height_m
    begun = subject.tempo * t + _LONGEST_S * subject.phase
    forward, sideways = (
        subject.amplitude * size * sway(begun, phases)
        for size, phases in zip((FORWARD_M, SIDEWAYS_M), _PHASES, strict=True)
    )
    # A leg is all but straight: it reaches from the ankle to a hip that moves on a circle about it.
    pendulum = (ROOT - ANKLE - 0.001) * height
    lean, aside = LEAN + forward / pendulum, sideways / pendulum
    upright = pendulum * np.cos(aside)
    root = xyz(
        upright * np.sin(lean), pendulum * np.sin(aside), ANKLE * height + upright * np.cos(lean)
    )
    body = about(y=lean)
    arms = {
        side: swing_arm(
            body,
            side,
            forward=LEAN + math.radians(4),
            outward=math.radians(8),
            elbow=np.full(len(t), math.radians(12) * subject.uneven[side]),
        )
        for side in SIDES
    }
    still = np.zeros(len(t))
    ankles = {
        side: xyz(still, sign * 1.1 * HIP_Y * height, ANKLE * height)
        for side, sign in SIDES.items()
    }
    feet = {side: about(z=still + sign * math.radians(8)) for side, sign in SIDES.items()}
    return Pose(
        root=root,
        pelvis=body,
        thorax=body,
        head=about(y=still + math.radians(2)),
        ankles=ankles,
        feet=feet,
        arms=arms,
        left=LEFT,
    )
