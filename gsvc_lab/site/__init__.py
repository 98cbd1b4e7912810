"""The documents as a static site: `make site`.

`document` reads spec.md, and `markdown` any document; `equations` sets equations; `references` links what has an id to its place;
`syntax` reads the syntax tables, which `browser` and `glance` show; `search` makes the index; `page` puts pages together; `build`
writes them all.
"""
