"""Long encodes: groups of pictures side by side, on one machine or many, and kept so that an encode can be resumed.

`encode_once` encodes a video in any of these ways. `side_by_side` has `groups` of pictures encoded by an executor, such
as the `processes` of this machine or a `cluster`, whose workers run `cluster_task`. `resume` keeps a `kept_group` of
each in a folder, and goes on from there, if `code_version` is the same.
"""
