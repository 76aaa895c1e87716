"""The answer to a question whose answer is still being found, so that nobody reads 'not yet' as 'nothing'."""

from enum import Enum
from typing import Final


class NotYet(Enum):
    """Its one value is to be asked again."""

    NOT_YET = "still being found"


NOT_YET: Final = NotYet.NOT_YET
