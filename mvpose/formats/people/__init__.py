"""People over time in the file formats of the field, read and written.

:func:`read_people` reads any of the formats that are read, and :func:`write_people` writes several formats at once;
:data:`mvpose.formats.people.people_formats.FORMATS` lists them.
"""

from mvpose.formats.people.people_files import Export, Options, PeopleFiles
from mvpose.formats.people.people_formats import (
    FORMATS,
    PeopleFormat,
    check_formats,
    read_people,
    register,
    write_people,
)

__all__ = [
    "FORMATS", "Export", "Options", "PeopleFiles", "PeopleFormat", "check_formats", "read_people", "register",
    "write_people",
]  # fmt: skip
