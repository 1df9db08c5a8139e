"""The routes, by what they are about. Each is thin: types in, one call, types out; its docstring is the manual."""
