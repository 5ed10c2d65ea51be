"""Physics of the injector: parameters, right-hand side, RK4. Pure: no files, sockets or clocks."""
