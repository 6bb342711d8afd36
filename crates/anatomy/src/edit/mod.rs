//! Editing of label volumes: selections, tools, and a journal that undoes, redoes and survives a kill.
