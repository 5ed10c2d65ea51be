"""Maps of an injector, masses by rail pressure and energizing time: read, fitted, shown."""
