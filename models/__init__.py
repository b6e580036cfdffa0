"""Models ready to simulate, one file each; every factory returns a :class:`hybrid.HybridSystem`."""

from models.ball_chain import ball_chain as ball_chain
from models.bilinear_oscillator import bilinear_oscillator as bilinear_oscillator
from models.bouncing_ball import bouncing_ball as bouncing_ball
from models.bouncing_table import bouncing_table as bouncing_table
from models.buck_converter import buck_converter as buck_converter
from models.chua_circuit import chua_circuit as chua_circuit
from models.dry_friction_oscillator import dry_friction_oscillator as dry_friction_oscillator
from models.impact_oscillator import impact_oscillator as impact_oscillator
from models.impact_pair import impact_pair as impact_pair
from models.rimless_wheel import rimless_wheel as rimless_wheel
from models.rocking_block import rocking_block as rocking_block
from models.simplest_walker import simplest_walker as simplest_walker
from models.slip_hopper import slip_hopper as slip_hopper
from models.solvable_oscillator import solvable_oscillator as solvable_oscillator
from models.stick_slip import coulomb_stick_slip as coulomb_stick_slip
from models.stick_slip import stick_slip as stick_slip
from models.stop_oscillator import stop_oscillator as stop_oscillator
from models.switched_arrival import switched_arrival as switched_arrival
from models.three_disk_billiard import three_disk_billiard as three_disk_billiard
from models.vibroimpact import vibroimpact as vibroimpact
