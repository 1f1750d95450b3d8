from sph.api import (
    Checkpoint as Checkpoint,
)
from sph.api import (
    Particles as Particles,
)
from sph.api import (
    Run as Run,
)
from sph.api import (
    Simulation as Simulation,
)
from sph.api import (
    View as View,
)
from sph.api import (
    open as open,
)
from sph.api import (
    run as run,
)
from sph.errors import (
    ConfigError as ConfigError,
)
from sph.errors import (
    FileError as FileError,
)
from sph.errors import (
    NumericalError as NumericalError,
)
from sph.errors import (
    SphError as SphError,
)
from sph.errors import (
    Stopped as Stopped,
)
from sph.problems.base import InitialState as InitialState
from sph.problems.base import Limit as Limit
from sph.problems.base import Problem as Problem
from sph.version import __version__ as __version__
