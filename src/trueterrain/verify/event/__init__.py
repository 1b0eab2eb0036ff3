"""Excitation events: design, cut list, and what a vehicle does when it crosses one."""
