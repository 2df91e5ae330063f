# SPDX-License-Identifier: Apache-2.0
"""What a scene holds that the renderer approximates or leaves out, by name: once per render, in the log and a panel."""
import re

WRONG, APPROXIMATED, NUANCE = range(3)  # severities, worst first

# What a viewer of the picture misses or finds in it; all else is near what was asked for.
_WRONG = re.compile(r"left out|not there|without data|without an image|without the|constant|taken as black|cannot|"
                    r"in place of|nothing within|should see|cast them here|light all here|all see here|ordinary objects|perspective ones|is rendered alone")
# What only a measurement tells.
_NUANCES = re.compile(r"of the same median width|coats?, taken as|cut to that|rendered by Cycles into an image|"
                      r"read with a remark|moved to the origin|Diffuse parts of two models|Colours above 1|shapes? of the aperture|"
                      r"Bump Map Correction", re.I)


def severity_of(text):
    return NUANCE if _NUANCES.search(text) else WRONG if _WRONG.search(text) else APPROXIMATED


class Report:
    def __init__(self):
        self._notes = {}  # what was done -> names, in order of appearance

    def note(self, name, text):
        """`name` is the user's (a material, light or object), `text` says what is done in its place."""
        names = self._notes.setdefault(text, [])
        if name not in names:
            names.append(name)

    def texts(self):
        return list(self._notes)

    def take(self, other, texts=None):
        """What another report notes; `texts`: those alone."""
        for text, names in other._notes.items():
            for name in names if texts is None or text in texts else ():
                self.note(name, text)

    def __bool__(self):
        return bool(self._notes)

    def entries(self):
        """[(severity, text, names)], worst first."""
        return sorted(((severity_of(text), text, list(names)) for text, names in self._notes.items()), key=lambda entry: entry[0])

    def lines(self, most_names=None):
        """One line per approximation, worst first, with the names it applies to; `most_names`: others are counted."""
        result = []
        for _, text, names in self.entries():
            shown = names if most_names is None or len(names) <= most_names else names[:most_names]
            more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
            result.append(f"{text}: {', '.join(shown)}{more}")
        return result
