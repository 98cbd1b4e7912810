"""The operations, group by group: gsvc_ref's answer and the oracle of each."""
