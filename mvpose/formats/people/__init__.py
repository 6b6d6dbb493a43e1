"""Writers of tracked people in the file formats of the field.

:func:`write_people` writes several formats at once; :data:`mvpose.formats.people.people_formats.FORMATS` lists them.
"""

from mvpose.formats.people.people_files import Export, Options
from mvpose.formats.people.people_formats import FORMATS, PeopleFormat, check_formats, register, write_people

__all__ = ["FORMATS", "Export", "Options", "PeopleFormat", "check_formats", "register", "write_people"]
