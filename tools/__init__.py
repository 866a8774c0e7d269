"""Programs for operators and developers."""

# Before numpy is loaded: importing fusiond keeps linear algebra to one thread, as in the daemon that is measured.
import fusiond  # noqa: F401
