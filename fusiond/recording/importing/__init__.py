"""Foreign recordings into logs: where each sensor's numbers stand is said by a small mapping file."""

from fusiond.recording.importing.importer import Imported, import_recording

__all__ = ["Imported", "import_recording"]
