"""Records of the normal laws of the interface, with compliance, attraction and initial gaps."""

from meeframe.plugin import ContactLaw, Record
from meeframe_laws.adhesive import DMT, DMTCoulomb, Dugdale
from meeframe_laws.compliant import Compliant
from meeframe_laws.gaps import SignoriniGap
from meeframe_laws.hardness import Hardness

RECORDS: list[Record[ContactLaw]] = [
    Record(
        "compliant",
        Compliant,
        "pressure p_0 (closure / d_0)^exponent of a rough interface, Coulomb friction",
        "Oden & Martins, Comput. Methods Appl. Mech. Eng. 52 (1985) 527-634",
    ),
    Record(
        "dmt",
        DMT,
        "hard contact, van der Waals attraction across the gap, Coulomb friction",
        "Derjaguin, Muller & Toporov, J. Colloid Interface Sci. 53 (1975) 314-326",
    ),
    Record(
        "dmt-coulomb",
        DMTCoulomb,
        "friction limit mu (|p| + p_adh) in contact, p_adh an adhesive offset",
        "Derjaguin, Z. Phys. 88 (1934) 661-675",
    ),
    Record(
        "dugdale",
        Dugdale,
        "hard contact, constant attraction of limited range, Coulomb friction",
        "Maugis, J. Colloid Interface Sci. 150 (1992) 243-269",
    ),
    Record(
        "hardness",
        Hardness,
        "unilateral contact with pressures up to the hardness, perfectly plastic asperities, Coulomb friction",
        "Almqvist, Sahlin, Larsson & Glavatskih, Tribol. Int. 40 (2007) 574-579",
    ),
    Record(
        "signorini-gap",
        SignoriniGap,
        "unilateral contact with an initial gap, waves or heights from a file, Coulomb friction",
        "Johnson, Contact Mechanics (1985), section 13.2",
    ),
]
"""Contact laws that this module registers."""
