"""Prints the outlines of a TrueType font's characters, one line per character: code point in
hexadecimal, advance and path data in font units, y upwards. The first line contains the units per
em.
"""

import sys
from fontTools.pens.basePen import BasePen
from fontTools.ttLib import TTFont

class Outline(BasePen):
    def __init__(self, glyphs):
        super().__init__(glyphs)
        self.parts = []
    def _moveTo(self, p): self.parts.append("M%d,%d" % p)
    def _lineTo(self, p): self.parts.append("L%d,%d" % p)
    def _qCurveToOne(self, c, p): self.parts.append("Q%g,%g,%g,%g" % (*c, *p))
    def _closePath(self): self.parts.append("Z")

font = TTFont(sys.argv[1])
glyphs = font.getGlyphSet()
print("units\t%d" % font["head"].unitsPerEm)
for code, name in sorted(font.getBestCmap().items()):
    pen = Outline(glyphs)
    glyphs[name].draw(pen)
    print("%04x\t%d\t%s" % (code, glyphs[name].width, " ".join(pen.parts)))
