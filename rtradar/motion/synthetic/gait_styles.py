"""Styles of walking: what differs between walkers, and six gaits, five of them of a lame side.

Ranges of normal walks follow recordings of CMU, Bandai-Namco and of Jun et al. (Pathological gait
datasets, IEEE Access 8, 2020); the others those of Jun et al., in which healthy people walk as
taught: antalgic (weight is taken off a leg that hurts), stiff-legged (a knee does not bend, and the
leg swings round), lurch (the trunk is thrown back over a weak hip), steppage (a foot drops, and the
knee is lifted) and Trendelenburg (the pelvis drops on the other side).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rtradar.motion.synthetic.figure import Subject


@dataclass(frozen=True, kw_only=True)
class Gait:
    """How somebody walks; lengths are fractions of the height, times at tempo 1 and 1.75 m.

    What is ``lame`` concerns the lame side only; a normal walker has none of it.
    """

    cycle_s: float
    step: float
    stance: float
    """Fraction of the cycle for which a foot is on the floor."""
    track: float
    sway: float
    """Motion of the hips to the standing foot, relative to the track."""
    bob: float
    pulse_mps: float
    """Amplitude of the speed of the hips, which is least over the standing foot."""
    trunk_pulse: float
    """The same of the base of the neck, relative to the hips."""
    toe_off_deg: float
    heel_strike_deg: float
    clearance: float
    swing_even: float
    """How much more evenly than with the least jerk a foot swings."""
    hip_yaw_deg: float
    chest_yaw_deg: float
    drop_deg: float
    """The hip of the swinging leg drops."""
    lateral_deg: float
    """The trunk leans over the standing foot."""
    lean_deg: float
    arm_deg: float
    arm_forward_deg: float
    arm_outward_deg: float
    elbow_deg: float
    elbow_swing_deg: float
    arm_lag_deg: float
    unsteady: float
    """Deviation of single steps in length and time."""
    lame_stance: float = 0.0
    """Change of `stance`."""
    lame_late: float = 0.0
    """Delay of the landing, relative to half a cycle."""
    lame_step: float = 0.0
    """Change of the step, relative to half of both."""
    lame_lift: float = 0.0
    lame_aside: float = 0.0
    lame_reach: float = 0.0
    """Ways of the swinging foot up, outward and forward, beyond those of a normal step."""
    lame_end: float = 1.5
    """They are largest in the middle of the swing with 1, and the later the larger it is."""
    lame_toe_off_deg: float = 0.0
    """Change of `toe_off_deg`."""
    lame_landing_deg: float = 0.0
    """Change of the pitch at landing; toes down are positive."""
    lame_hike_deg: float = 0.0
    """The hip goes up in swing."""
    lame_drop_deg: float = 0.0
    """The other hip drops in stance."""
    lame_dip: float = 0.0
    lame_sway: float = 0.0
    """The root goes down and to the side in stance."""
    lame_away_deg: float = 0.0
    lame_leant_deg: float = 0.0
    """The trunk leans to the sound side in swing, and in stance."""
    lame_back_deg: float = 0.0
    """The trunk is thrown back as the leg comes forward."""
    lame_arm: float = 0.0
    """Loss of the swing of the arm on that side."""

    def stance_of(self, lame: float) -> float:
        """Part of the cycle for which a foot stands, that of the lame side with ``lame`` = 1."""
        return self.stance + lame * self.lame_stance

    def midstance(self, lame: float = 0.0) -> float:
        """Part of the cycle from landing until the body is over the foot, later in long stances."""
        return 0.7 * self.stance_of(lame) ** 2

    def cycle_of(self, subject: Subject) -> float:
        """Duration of two steps [s]; it grows with the root of the height."""
        return self.cycle_s * math.sqrt(subject.height_m / 1.75 / subject.tempo)

    def step_of(self, subject: Subject) -> float:
        """Length of one step [m]; who walks faster takes longer and quicker steps alike."""
        return self.step * subject.height_m * subject.amplitude * math.sqrt(subject.tempo)


_NORMAL = {
    "cycle_s": (1.08, 1.2),
    "step": (0.34, 0.4),
    "stance": (0.53, 0.57),
    "track": (0.03, 0.045),
    "sway": (0.25, 0.45),
    "bob": (0.009, 0.0125),
    "pulse_mps": (0.23, 0.36),
    "trunk_pulse": (0.6, 0.85),
    "toe_off_deg": (40.0, 55.0),
    "heel_strike_deg": (12.0, 22.0),
    "clearance": (0.03, 0.045),
    "swing_even": (0.22, 0.46),
    "hip_yaw_deg": (6.5, 10.0),
    "chest_yaw_deg": (3.0, 7.0),
    "drop_deg": (2.5, 5.0),
    "lateral_deg": (0.5, 2.5),
    "lean_deg": (0.0, 5.0),
    "arm_deg": (15.0, 27.0),
    "arm_forward_deg": (-4.0, 6.0),
    "arm_outward_deg": (7.0, 15.0),
    "elbow_deg": (14.0, 30.0),
    "elbow_swing_deg": (6.0, 20.0),
    "arm_lag_deg": (0.0, 25.0),
    "unsteady": (0.01, 0.03),
}
"""Ranges of a normal walker; a subject is drawn from them."""

_SLOW = {
    "cycle_s": (1.22, 1.72),
    "step": (0.215, 0.3),
    "stance": (0.61, 0.66),
    "track": (0.035, 0.055),
    "sway": (0.3, 0.7),
    "bob": (0.002, 0.009),
    "pulse_mps": (0.08, 0.27),
    "toe_off_deg": (24.0, 38.0),
    "heel_strike_deg": (8.0, 18.0),
    "clearance": (0.02, 0.032),
    "lateral_deg": (1.5, 6.0),
    "arm_deg": (10.0, 26.0),
    "hip_yaw_deg": (4.0, 11.0),
    "unsteady": (0.015, 0.035),
    "lame_arm": (0.2, 0.7),
    "lean_deg": (0.0, 7.0),
}

GAITS = {
    "normal": {},
    "antalgic": _SLOW
    | {
        "cycle_s": (0.95, 1.5),
        "step": (0.17, 0.27),
        "lean_deg": (3.0, 11.0),
        "stance": (0.68, 0.71),
        "lame_stance": (-0.23, -0.2),
        "lame_late": (0.16, 0.27),
        "lame_step": (-0.65, -0.35),
        "lame_hike_deg": (2.0, 5.0),
        "lame_away_deg": (4.0, 11.0),
        "lame_toe_off_deg": (-10.0, 5.0),
        "lame_landing_deg": (6.0, 14.0),
    },
    "stiff_legged": _SLOW
    | {
        "lean_deg": (0.0, 4.0),
        "lame_stance": (-0.13, -0.1),
        "lame_late": (0.04, 0.1),
        "lame_step": (-0.2, 0.05),
        "lame_lift": (0.004, 0.012),
        "lame_aside": (0.1, 0.15),
        "lame_toe_off_deg": (-18.0, -8.0),
        "lame_hike_deg": (7.0, 12.0),
        "lame_away_deg": (8.0, 14.0),
        "stance": (0.64, 0.68),
    },
    "lurch": _SLOW
    | {
        "cycle_s": (1.3, 1.95),
        "step": (0.24, 0.3),
        "stance": (0.66, 0.69),
        "lame_stance": (-0.18, -0.14),
        "lame_late": (0.1, 0.2),
        "lame_step": (0.0, 0.16),
        "lame_lift": (0.05, 0.1),
        "lame_reach": (0.08, 0.15),
        "lame_end": (2.6, 3.6),
        "lame_hike_deg": (6.0, 12.0),
        "lame_back_deg": (16.0, 30.0),
    },
    "steppage": _SLOW
    | {
        "step": (0.23, 0.32),
        "lame_stance": (-0.13, -0.1),
        "lame_late": (0.04, 0.1),
        "lame_lift": (0.045, 0.085),
        "lame_reach": (0.05, 0.09),
        "lame_landing_deg": (16.0, 30.0),
        "lame_hike_deg": (7.0, 12.0),
        "lame_away_deg": (3.0, 10.0),
        "stance": (0.64, 0.68),
    },
    "trendelenburg": _SLOW
    | {
        "cycle_s": (1.2, 1.9),
        "step": (0.19, 0.3),
        "lame_stance": (-0.06, -0.01),
        "lame_late": (0.0, 0.1),
        "lame_step": (-0.2, 0.0),
        "lame_drop_deg": (4.0, 9.0),
        "lame_leant_deg": (3.0, 14.0),
        "lame_dip": (0.01, 0.028),
        "lame_sway": (0.02, 0.04),
    },
}
"""Ranges of each style, where they are not those of a normal walker."""


_IN_PLACE = {
    "cycle_s": (0.8, 1.25),
    "step": (1e-6, 2e-6),
    "stance": (0.56, 0.66),
    "sway": (0.4, 1.0),
    "pulse_mps": (0.0, 0.06),
    "toe_off_deg": (10.0, 36.0),
    "heel_strike_deg": (-14.0, 2.0),
    "clearance": (0.012, 0.12),
    "hip_yaw_deg": (3.0, 9.0),
    "lean_deg": (0.0, 8.0),
}
"""Ranges of who walks in place, where they are not those of a normal walker."""


def gait_of(subject: Subject, *, in_place: bool) -> Gait:
    """Draw how a subject walks."""
    ranges = _NORMAL | (_IN_PLACE if in_place else GAITS[subject.style or "normal"])
    return Gait(**{name: subject.drawn(name, *between) for name, between in ranges.items()})
