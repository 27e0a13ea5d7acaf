"""Every write, fsync, rename and removal of a writing command, killed or failed one by one."""
