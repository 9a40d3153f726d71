"""The subjects of the stability map: what measures each of them, and its figure."""

from . import bulk, contact, loading, membrane, steps

#: Of each subject what measures it, as values fit for JSON, and what draws a figure of these.
SUBJECTS = steps.SUBJECTS | loading.SUBJECTS | contact.SUBJECTS | bulk.SUBJECTS | membrane.SUBJECTS

__all__ = ["SUBJECTS"]
