"""How noise is estimated, in the template: by interacting models. `assembly` writes a configuration's own choice."""

from fusiond.adapt.interacting import begin, weigh

__all__ = ["begin", "weigh"]
