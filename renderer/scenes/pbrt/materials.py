"""
pbrt's materials as Mitsuba's BSDFs. Where the models differ the nearest is drawn, and the report says so.

Reflecting surfaces are two-sided in pbrt, so they stand in ``twosided`` here. Roughness is remapped as pbrt does
(``remaproughness``). Source: pbrt-v3, src/materials.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from renderer.errors import SceneError, UnknownName, shown
from renderer.scenes.pbrt import xml
from renderer.scenes.pbrt.lexer import Place
from renderer.scenes.pbrt.parameters import Parameters
from renderer.scenes.pbrt.parser import Folder
from renderer.scenes.pbrt.report import Report
from renderer.scenes.pbrt.textures import Constant, Floats, Reader, Texture
from renderer.scenes.pbrt.texturexml import TextureWriter
from renderer.scenes.pbrt.xml import Xml

COPPER_ETA = (0.2004376970, 0.9240334304, 1.1022119527)  # pbrt's default metal, as its RGB build sees it
COPPER_K = (3.9129485033, 2.4528477015, 2.1421879552)
MIX_DEPTH_MAX = 8

# Parameters of materials, which a shape may override.
OVERRIDES = frozenset(
    """
    Kd Ks Kr Kt roughness uroughness vroughness sigma eta index k opacity remaproughness bumpmap amount reflect transmit
    color metallic speculartint anisotropic sheen sheentint clearcoat clearcoatgloss spectrans flatness thin Rd Rs nu nv
    """.split()  # noqa: SIM905
)
REPLACED = frozenset({"translucent", "hair", "fourier", "subsurface", "kdsubsurface"})


@dataclass(frozen=True, eq=False)
class Material:
    """
    A material of the file, with the textures that were defined when it was.

    name  of a named material; "" for others
    """

    kind: str
    parameters: Parameters
    floats: Mapping[str, Texture]
    spectra: Mapping[str, Texture]
    name: str = ""

    @property
    def identity(self) -> str:
        """What it is called in the scene that is made."""
        kind = self.kind or "none"
        return xml.word(self.name or f"{kind}_{self.parameters.place.line}")


@dataclass(frozen=True)
class Surface:
    """
    A BSDF.

    uses_uv   textured or anisotropic: the shape has to have u and v as pbrt does
    textured  it has to be written again for a shape whose v runs the other way
    """

    bsdf: Xml
    uses_uv: bool
    textured: bool


class MaterialWriter:
    """Makes BSDFs. ``named`` are the named materials that a mix may refer to, at the time it is made."""

    def __init__(self, folder: Folder, report: Report, textures: TextureWriter):
        self.folder = folder
        self.report = report
        self.textures = textures

    def write(
        self, material: Material, given: Parameters, named: Mapping[str, Material], *, upside_down: bool
    ) -> Surface:
        """
        The BSDF of a material whose parameters are ``given``: its own, or those below a shape's.

        Raises ``SceneError`` for a parameter or texture that cannot be.
        """
        return _Writing(self, material, given, named, upside_down, 0).surface()


class _Writing:
    """One BSDF in the making."""

    def __init__(self, writer: MaterialWriter, material: Material, given: Parameters, named: Mapping[str, Material],
                 upside_down: bool, depth: int):  # fmt: skip
        self.writer, self.material, self.given, self.named = writer, material, given, named
        self.report, self.upside_down, self.depth = writer.report, upside_down, depth
        self.reader = Reader(writer.folder, writer.report, material.floats, material.spectra)
        self.place: Place = material.parameters.place
        self.textured = self.anisotropic = False

    def surface(self) -> Surface:
        kind = self.material.kind.lower().replace("_", "")
        makers = {
            "matte": self.matte, "plastic": self.plastic, "mirror": self.mirror, "glass": self.glass,
            "metal": self.metal, "uber": self.uber, "substrate": self.substrate, "disney": self.disney,
            "anisotropicphong": self.anisotropic_phong, "anisophong": self.anisotropic_phong, "mix": self.mix,
            "": self.nothing, "none": self.nothing,
        }  # fmt: skip
        if kind in makers:
            made = makers[kind]()
        else:
            told = "is not supported" if kind in REPLACED else "is unknown"
            self.note(f"the material {shown(self.material.kind)} {told}; matte is drawn in its place")
            made = self.matte()
            self.given.ignore(*self.given.items)
        return Surface(made, self.textured or self.anisotropic, self.textured)

    # Each of pbrt's materials.

    def matte(self) -> Xml:
        if self.number("sigma", 0) != 0:
            self.note("sigma of a matte material (Oren-Nayar) is not supported; it is drawn as a plain diffuse surface")
        return self.two_sided(xml.plugin("bsdf", "diffuse", self.colour("Kd", 0.5, "reflectance")))

    def plastic(self, eta: float = 1.5) -> Xml:
        alpha = self.alpha("roughness", 0.1)
        if self.is_black("Ks", 0.25):
            return self.two_sided(xml.plugin("bsdf", "diffuse", self.colour("Kd", 0.25, "reflectance")))
        self.note(
            f"the material {self.material.kind} is drawn as roughplastic: its diffuse part is the light that the coat "
            "lets through, where pbrt adds both"
        )
        return self.two_sided(
            xml.plugin(
                "bsdf",
                "roughplastic",
                xml.value("string", "distribution", "ggx"),
                xml.value("float", "alpha", alpha),
                xml.value("float", "int_ior", eta),
                xml.value("float", "ext_ior", 1.0),
                self.colour("Kd", 0.25, "diffuse_reflectance"),
                self.colour("Ks", 0.25, "specular_reflectance"),
            )
        )

    def mirror(self) -> Xml:
        return self.two_sided(
            xml.plugin(
                "bsdf",
                "conductor",
                xml.value("string", "material", "none"),
                self.colour("Kr", 0.9, "specular_reflectance"),
            )
        )

    def glass(self) -> Xml:
        parts = [
            xml.value("float", "int_ior", self.eta()), xml.value("float", "ext_ior", 1.0),
            self.colour("Kr", 1.0, "specular_reflectance"), self.colour("Kt", 1.0, "specular_transmittance"),
        ]  # fmt: skip
        u, v = self.number("uroughness", 0), self.number("vroughness", 0)
        remapped = self.given.flag("remaproughness", True)
        if u == v == 0:
            return self.bumped(xml.plugin("bsdf", "dielectric", *parts))
        self.anisotropic = u != v
        lobes = [xml.value("float", key, remap(x) if remapped else max(x, 1e-4)) for key, x in
                 (("alpha_u", u), ("alpha_v", v))]  # fmt: skip
        return self.bumped(
            xml.plugin("bsdf", "roughdielectric", xml.value("string", "distribution", "ggx"), *lobes, *parts)
        )

    def metal(self) -> Xml:
        eta, k = (
            xml.rgb(name, self.mean(self.reader.need(self.given, name, np.array(default), 3), name))
            for name, default in (("eta", COPPER_ETA), ("k", COPPER_K))
        )
        return self.two_sided(
            xml.plugin("bsdf", "roughconductor", xml.value("string", "distribution", "ggx"), *self.alphas(0.01), eta, k)
        )

    def uber(self) -> Xml:
        for name in ("Kr", "Kt"):
            if name in self.given and not self.is_black(name, 0):
                self.note(f"{name} of an uber material is not supported; it is left out")
            self.given.ignore(name)
        eta = self.eta()
        if "uroughness" in self.given or "vroughness" in self.given:
            self.note("an uber material is drawn with one roughness for both directions")
            self.given.ignore("uroughness", "vroughness")
        made = self.plastic(eta)
        opacity = self.reader.value(self.given, "opacity", None, 3)
        if opacity is None or (isinstance(opacity, Constant) and (opacity.value >= 1).all()):
            return made
        return xml.plugin("bsdf", "mask", self.texture(opacity, "opacity", grey=True), made)

    def substrate(self) -> Xml:
        """Ashikhmin and Shirley's model too; only its half-vector distribution is GGX's in pbrt."""
        self.note("the material substrate is drawn as anisophong: the same model, with a Phong lobe of like width")
        u, v = (2 / max(alpha, 1e-3) ** 2 - 2 for alpha in self.alpha_pair(0.1))
        return self.phong(("Kd", "Ks"), max(u, 0.0), max(v, 0.0))

    def anisotropic_phong(self) -> Xml:
        return self.phong(("Rd", "Rs"), self.number("nu", 100), self.number("nv", 100))

    def phong(self, names: tuple[str, str], nu: float, nv: float) -> Xml:
        for key, exponent in (("nu", nu), ("nv", nv)):
            if exponent < 0:
                raise SceneError(f"{self.place}: {key} = {exponent:g} of {self.given.owner}; an exponent is 0 or more")
        self.anisotropic = nu != nv
        return self.two_sided(
            xml.plugin(
                "bsdf",
                "anisophong",
                self.colour(names[0], 0.5, "rd"),
                self.colour(names[1], 0.5, "rs"),
                xml.value("float", "nu", nu),
                xml.value("float", "nv", nv),
            )
        )

    def disney(self) -> Xml:
        keys = {
            "metallic": (0.0, "metallic"), "roughness": (0.5, "roughness"), "speculartint": (0.0, "spec_tint"),
            "anisotropic": (0.0, "anisotropic"), "sheen": (0.0, "sheen"), "sheentint": (0.5, "sheen_tint"),
            "clearcoat": (0.0, "clearcoat"), "clearcoatgloss": (1.0, "clearcoat_gloss"),
            "spectrans": (0.0, "spec_trans"),
        }  # fmt: skip
        parts = [self.colour("color", 0.5, "base_color"), xml.value("float", "eta", self.eta())]
        parts += [self.texture(self.reader.need(self.given, name, default, 1), key)
                  for name, (default, key) in keys.items() if name in self.given or name == "roughness"]  # fmt: skip
        self.anisotropic = "anisotropic" in self.given
        self.note("the material disney is drawn as principled: the same family, not the same formulas")
        for name in ("scatterdistance", "thin", "flatness", "difftrans"):
            if name in self.given:
                self.note(f"{name} of a disney material is not supported; it is left out")
            self.given.ignore(name)
        made = xml.plugin("bsdf", "principled", *parts)
        return self.bumped(made) if "spectrans" in self.given else self.two_sided(made)

    def mix(self) -> Xml:
        if self.depth >= MIX_DEPTH_MAX:
            raise SceneError(f"{self.place}: mix materials nest deeper than {MIX_DEPTH_MAX}, or in a circle")
        parts = []
        for key in ("namedmaterial2", "namedmaterial1"):  # Mitsuba's weight is that of the second
            wanted = self.given.text(key)
            if wanted not in self.named:
                raise SceneError(str(UnknownName("material", wanted, str(self.place), list(self.named)[:20])))
            inner = self.named[wanted]
            part = _Writing(self.writer, inner, inner.parameters, self.named, self.upside_down, self.depth + 1)
            found = part.surface()
            self.textured |= found.textured
            self.anisotropic |= found.uses_uv and not found.textured
            parts.append(found.bsdf)
        amount = self.reader.need(self.given, "amount", 0.5, 3)
        return xml.plugin("bsdf", "blendbsdf", self.texture(amount, "weight", grey=True), *parts)

    def nothing(self) -> Xml:
        return xml.plugin("bsdf", "null")

    # What they are made of.

    def note(self, text: str) -> None:
        self.report.note(self.place, text)

    def texture(self, texture: Texture, name: str, *, grey: bool = False) -> Xml:
        """``grey``: three channels where Mitsuba wants one number."""
        if isinstance(texture, Constant):
            if grey:
                texture = Constant(texture.place, np.array([texture.value.mean()]))
        else:
            self.textured = True
        return self.writer.textures.write(texture, name, upside_down=self.upside_down)

    def colour(self, name: str, default: float, key: str) -> Xml:
        return self.texture(self.reader.need(self.given, name, default, 3), key)

    def is_black(self, name: str, default: float) -> bool:
        found = self.reader.need(self.given, name, default, 3)
        return isinstance(found, Constant) and not found.value.any()

    def number(self, name: str, default: float) -> float:
        """A float that may be a texture, whose mean is taken."""
        return float(self.mean(self.reader.need(self.given, name, default, 1), name)[0])

    def mean(self, texture: Texture, name: str) -> Floats:
        if isinstance(texture, Constant):
            return texture.value
        self.note(f"the texture of {name} is drawn as its mean")
        centres = (np.arange(64) + 0.5) / 64
        value: Floats = texture.at(*np.meshgrid(centres, centres)).mean(axis=(0, 1))
        return value

    def eta(self) -> float:
        """pbrt reads "eta", and "index" where there is none. Raises ``SceneError`` for one that refracts nothing."""
        value = self.number("eta", self.number("index", 1.5))
        if value <= 0:
            raise SceneError(f"{self.place}: the index of refraction {value:g}; give more than 0")
        return value

    def alpha(self, name: str, default: float) -> float:
        rough = self.number(name, default)
        return remap(rough) if self.given.flag("remaproughness", True) else max(rough, 1e-4)

    def alpha_pair(self, default: float) -> tuple[float, float]:
        both = self.number("roughness", default)
        u, v = self.number("uroughness", both), self.number("vroughness", both)
        self.anisotropic = u != v
        remapped = self.given.flag("remaproughness", True)
        return (remap(u), remap(v)) if remapped else (max(u, 1e-4), max(v, 1e-4))

    def alphas(self, default: float) -> list[Xml]:
        return [
            xml.value("float", key, a) for key, a in zip(("alpha_u", "alpha_v"), self.alpha_pair(default), strict=True)
        ]

    def two_sided(self, inner: Xml) -> Xml:
        return xml.plugin("bsdf", "twosided", self.bumped(inner))

    def bumped(self, inner: Xml) -> Xml:
        """With a bump map around it, if there is one: a displacement in units of the scene, as Mitsuba has it."""
        bump = self.reader.value(self.given, "bumpmap", None, 1)
        if bump is None or isinstance(bump, Constant):
            return inner
        self.textured = True
        texture = self.writer.textures.write(bump, "", upside_down=self.upside_down, bounded=False, smooth=True)
        texture.attrib.pop("name", None)
        return xml.plugin("bsdf", "bumpmap", texture, inner)


def remap(roughness: float) -> float:
    """pbrt's roughness in [0, 1] → alpha of GGX (TrowbridgeReitzDistribution::RoughnessToAlpha)."""
    x = np.log(max(roughness, 1e-3))
    return float(1.62142 + 0.819955 * x + 0.1734 * x**2 + 0.0171201 * x**3 + 0.000640711 * x**4)
