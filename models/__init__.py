"""Models ready to simulate, one file each; every factory returns a :class:`hybrid.HybridSystem`."""

from models.bouncing_ball import bouncing_ball as bouncing_ball
from models.dry_friction_oscillator import dry_friction_oscillator as dry_friction_oscillator
from models.impact_oscillator import impact_oscillator as impact_oscillator
from models.rimless_wheel import rimless_wheel as rimless_wheel
from models.simplest_walker import simplest_walker as simplest_walker
from models.slip_hopper import slip_hopper as slip_hopper
from models.stick_slip import coulomb_stick_slip as coulomb_stick_slip
from models.stick_slip import stick_slip as stick_slip
from models.vibroimpact import vibroimpact as vibroimpact
