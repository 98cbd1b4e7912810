"""Pages that people read: charts, tables, pictures and text between markers, and the report about one encoding.

`page` puts a self-contained HTML page together and `charts`, `tables` and `pictures` its parts; `markers` changes a
part of a Markdown document; `report` is the page about one encoding, made of what `data` holds.
"""
