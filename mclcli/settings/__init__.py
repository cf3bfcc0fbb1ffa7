"""Every parameter in one table, by profile; and the robots' own files of parameters."""
