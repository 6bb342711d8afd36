//! A case and time to snapshots: the scripted and the live insertion.
