// Mitsuba scenes of before version 2 in the words of version 3.
#pragma once

#include <pugixml.hpp>

namespace lumicut::io {

void upgrade_mitsuba(pugi::xml_node scene);

}  // namespace lumicut::io
