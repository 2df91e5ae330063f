// Photometric files of IESNA LM-63 (1986, 1991, 1995, 2002): intensity of a light by direction.
#pragma once

#include <string>
#include <vector>

#include "io/warnings.h"

namespace lumicut::io {

struct IesProfile {
  std::vector<double> vertical;    // degrees from the light's axis (down, as mounted), rising
  std::vector<double> horizontal;  // degrees about it, from 0 to 360; one alone: the same all around
  std::vector<double> candela;     // vertical.size() for each horizontal angle; multiplier and ballast factors are in
  double watts = 0;                // as the file says
  double lumens() const;           // of the table, exact for its bilinear interpolant
};

// TILT=NONE and TILT=INCLUDE (whose factor at 0 degrees is taken); types A and B are turned into C. Throws FileError
// naming line, field and value. export_scripts/lumicut_blender/ies.py reads the same: tests/io/ies_corpus.json.
IesProfile read_ies(const std::string& path, Warnings& warnings);
// The same from text; `path` is for messages.
IesProfile parse_ies(const std::string& text, const std::string& path, Warnings& warnings);

}  // namespace lumicut::io
