"""The command line: `fusiond COMMAND`.

Exit status 0: done; 1: the run failed (`diff`: they differ); 2: the operator's mistake, named with its remedy.
"""

from __future__ import annotations

import sys

from fusiond.cli.commands import app
from fusiond.errors import ConfigError, FusiondError, LogError


def main() -> None:
    """Run one command; every error made on purpose ends as one line that names the remedy."""
    try:
        app()
    except (ConfigError, LogError) as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except FusiondError as error:
        print(error, file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
