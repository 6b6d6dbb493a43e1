"""Writers of tracked people in the file formats of the field.

:func:`write_people` writes several formats at once; :data:`mvpose.formats.writers.registry.FORMATS` lists them.
"""

from mvpose.formats.writers.export import Export, Options
from mvpose.formats.writers.registry import FORMATS, PeopleFormat, check_formats, register, write_people

__all__ = ["FORMATS", "Export", "Options", "PeopleFormat", "check_formats", "register", "write_people"]
