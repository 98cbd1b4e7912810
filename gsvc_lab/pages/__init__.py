"""Charts and pictures of pages, whose frame is `gsvc_base.pages`, and the report about one encoding.

`report` is the page about one encoding, made of what `data` holds.
"""
