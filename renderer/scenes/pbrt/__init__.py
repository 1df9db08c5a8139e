"""
pbrt-v3 scene files as input: ``convert`` makes a Mitsuba scene of one. No Mitsuba in here.

lexer, parser   the file → directives, each with its parameters, file and line
transforms      pbrt's matrices
spectra         colours in all of pbrt's spellings → linear RGB
textures        pbrt's textures → Mitsuba's; what Mitsuba lacks becomes a picture
materials, lights, camera, shapes, meshes    one thing of the file → its XML
assembly        the scene as it grows: shapes with their materials and lamps, objects, instances
settings, filters    what the file says about its rendering
convert         the state machine: what the current transform, material, … are when a thing is met
report          what was replaced or ignored, each once, by line
"""
