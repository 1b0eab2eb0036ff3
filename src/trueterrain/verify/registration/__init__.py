"""Registration: position of a measured profile on a machined one."""
