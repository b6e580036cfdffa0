"""Models ready to simulate, one file each; every factory returns a :class:`hybrid.HybridSystem`."""

from models.ball_chain import ball_chain
from models.battery_cell import battery_cell
from models.bilinear_oscillator import bilinear_oscillator
from models.boost_converter import boost_converter
from models.bouncing_ball import bouncing_ball
from models.bouncing_table import bouncing_table
from models.buck_converter import buck_converter
from models.cam_follower import cam_follower
from models.chua_circuit import chua_circuit
from models.coulomb_stick_slip import coulomb_stick_slip
from models.delayed_neurons import delayed_neurons
from models.digital_pwm import digital_pwm
from models.dosing_schedule import dosing_schedule
from models.dry_friction_oscillator import dry_friction_oscillator
from models.gear_pair import gear_pair
from models.impact_oscillator import impact_oscillator
from models.impact_pair import impact_pair
from models.infusion_schedule import infusion_schedule
from models.interleaved_converter import interleaved_converter
from models.newtons_cradle import newtons_cradle
from models.pulse_coupled_neurons import pulse_coupled_neurons
from models.refractory_neuron import refractory_neuron
from models.relief_valve import relief_valve
from models.rimless_wheel import rimless_wheel
from models.rocking_block import rocking_block
from models.sampled_loop import sampled_loop
from models.shaken_stack import shaken_stack
from models.simplest_walker import simplest_walker
from models.slider_crank import slider_crank
from models.slip_hopper import slip_hopper
from models.solvable_oscillator import solvable_oscillator
from models.stick_slip import stick_slip
from models.stop_oscillator import stop_oscillator
from models.switched_arrival import switched_arrival
from models.three_disk_billiard import three_disk_billiard
from models.verge_escapement import verge_escapement
from models.vibroimpact import vibroimpact
from models.woodpecker import woodpecker

__all__ = [
    "ball_chain",
    "battery_cell",
    "bilinear_oscillator",
    "boost_converter",
    "bouncing_ball",
    "bouncing_table",
    "buck_converter",
    "cam_follower",
    "chua_circuit",
    "coulomb_stick_slip",
    "delayed_neurons",
    "digital_pwm",
    "dosing_schedule",
    "dry_friction_oscillator",
    "gear_pair",
    "impact_oscillator",
    "impact_pair",
    "infusion_schedule",
    "interleaved_converter",
    "newtons_cradle",
    "pulse_coupled_neurons",
    "refractory_neuron",
    "relief_valve",
    "rimless_wheel",
    "rocking_block",
    "sampled_loop",
    "shaken_stack",
    "simplest_walker",
    "slider_crank",
    "slip_hopper",
    "solvable_oscillator",
    "stick_slip",
    "stop_oscillator",
    "switched_arrival",
    "three_disk_billiard",
    "verge_escapement",
    "vibroimpact",
    "woodpecker",
]
