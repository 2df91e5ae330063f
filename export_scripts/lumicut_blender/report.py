# SPDX-License-Identifier: Apache-2.0
"""What a scene holds that the renderer approximates or leaves out, by name: once per render, in the log and a panel."""


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

    def lines(self, most_names=None):
        """One line per approximation, with the names it applies to; `most_names`: others are counted."""
        result = []
        for text, names in self._notes.items():
            shown = names if most_names is None or len(names) <= most_names else names[:most_names]
            more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
            result.append(f"{text}: {', '.join(shown)}{more}")
        return result
