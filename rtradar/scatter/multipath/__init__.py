"""Multipath: the person's echoes over and through the walls of a room.

The physics is in five files, in the order in which a wave meets it:

1. `image_paths`: the paths over walls and flat faces of furniture, and where their legs run (image
   method).
2. `wall_edges`: what the extents of walls, openings and faces leave of a wave (Fresnel integrals).
3. `slabs`: what a slab does to a wave, as a few delayed terms, by frequency and angle, and the
   field of a wave, as a vector, after reflections at and passages through walls.
4. `keyframes`: at keyframes, the field that a whole path leaves, and what occludes its legs.
5. `path_echoes`: at every chirp, lengths and amplitudes of the paths as if walls were perfect
   mirrors, and the delays in slabs.

`room_model.RoomModel.echoes` puts them together: the amplitude of an echo over walls is that of
`path_echoes` (divergence and curvature, for a conductor without polarisation), times the factor of
`keyframes` (polarisation, slabs, body material), times the fraction that is not occluded. The
product is made in `rtradar.kernels.scatter.rooms.path_amplitudes`. Where a level does not compute
all paths itself, each path has a model of it before an `ImageRadar`, in place of `path_echoes`.
"""
