"""Maps as map_server reads them, and the fields made of them, kept in the cache."""
