"""Real-time neural-network observer of a common-rail injector's injection rate over CAN."""

from observer_rt.foundation.compilation import use_own_cache

__version__ = "0.1.0"

use_own_cache()
