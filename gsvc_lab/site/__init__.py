"""The documents as a static site: `make site`.

`document` reads spec.md, and `markdown` any document. `equations` sets equations, and `references` links what has an
id. `syntax` reads the syntax tables, which `browser` and `glance` show. `search` makes the index, `page` puts pages
together, and `build` writes them all.
"""
