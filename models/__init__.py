"""Models ready to simulate, one file each; every factory returns a :class:`hybrid.HybridSystem`."""

from models.bilinear_oscillator import bilinear_oscillator as bilinear_oscillator
from models.bouncing_ball import bouncing_ball as bouncing_ball
from models.bouncing_table import bouncing_table as bouncing_table
from models.impact_oscillator import impact_oscillator as impact_oscillator
from models.impact_pair import impact_pair as impact_pair
from models.rocking_block import rocking_block as rocking_block
from models.stop_oscillator import stop_oscillator as stop_oscillator
from models.vibroimpact import vibroimpact as vibroimpact
