"""A virtual gonioreflectometer: the BRDF of a surface with real bumps, by rays.

The sample has area A on its mean plane z = 0. Parallel light from l with irradiance E_perp on a plane that
faces it gives the sample E_i = E_perp n.l, and the eye at v sees the mean radiance

    L_o = 1 / (A n.v) * integral of L(x -> v) <m.v> V(x, v) dA

over the surface with normals m, V = 1 where nothing is in the way. The BRDF is f_r = L_o / E_i.

Lambertian facets: rays that are uniform over the footprint as seen from v meet the visible surface with the
weight of this integral, so L_o is the mean of L(x -> v) over rays. L = rho / pi E_perp <m.l> V(x, l), so

    f_r = rho / pi * mean of <m.l> V(x, l) / n.l

Order k is the same at the k-th point of a path whose directions are drawn in proportion to the cosine; the
powers of the albedo rho are applied at the end, so that all channels share their rays.

Mirror facets: only those with m = h, the half vector, show light from l at v. Their area per solid angle of m
is A D(m), and d omega_m = d omega_v / (4 v.h), so

    f_r = F(v.h) D(h) mean of V(x, l) V(x, v) / (4 n.l n.v)        the mean over facets with m = h by area

which is Torrance and Sparrow's with the visible share of the facets in place of G. D is the area of triangles
whose normals lie in a ring about the polar angle of h, over A and the solid angle of the ring; each facet
of the ring is looked at with its own normal as h. A cell holds the mean of f_r over the ring, and nothing
else is approximated. In tables that are not isotropic rays from l are mirrored, and each that leaves
adds F^k over their number and the integral of n.v d omega_v over the cell that it leaves by.

References
----------
Torrance, K. E., Sparrow, E. M. (1967). Theory for off-specular reflection from roughened surfaces. JOSA
57(9).
Westin, S. H., Arvo, J. R., Torrance, K. E. (1992). Predicting reflectance functions from complex surfaces.
SIGGRAPH '92.
"""
