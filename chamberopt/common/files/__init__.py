"""Open, write, claim and remove files in a user's folders; only this package does so.

Each output has one writer, overwrites nothing, and is written whole or not at all. No link is
followed in a folder that the program writes to, or in its results and studies. See
docs/reference/trust.md.
"""

from chamberopt.common.files.claimed import (
    check_new_file,
    claim_file,
    claim_folder,
    is_new_or_empty,
    make_output_folder,
    require_place,
)
from chamberopt.common.files.opened import (
    INPUTS,
    RESULT,
    is_of_the_program,
    open_plain,
    read_file,
    require_plain_folder,
)
from chamberopt.common.files.written import (
    LEFTOVER_PREFIXES,
    append_bytes,
    csv_text,
    make_folder,
    new_file,
    private_folder,
    remove_file,
    remove_leftovers,
    whole_or_nothing,
    write_bytes,
    write_new_texts,
    write_text,
)

__all__ = [
    "INPUTS",
    "LEFTOVER_PREFIXES",
    "RESULT",
    "append_bytes",
    "check_new_file",
    "claim_file",
    "claim_folder",
    "csv_text",
    "is_new_or_empty",
    "is_of_the_program",
    "make_folder",
    "make_output_folder",
    "new_file",
    "open_plain",
    "private_folder",
    "read_file",
    "remove_file",
    "remove_leftovers",
    "require_place",
    "require_plain_folder",
    "whole_or_nothing",
    "write_bytes",
    "write_new_texts",
    "write_text",
]
