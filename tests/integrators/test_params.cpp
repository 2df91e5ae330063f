#include <gtest/gtest.h>

#include "core/error.h"
#include "integrators/integrator.h"

namespace lumicut {

namespace {
std::string error_of(Params& p, const char* name, const char* value) {
  try {
    p.set(name, value);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}
}  // namespace

TEST(Params, DefaultsOfEveryIntegratorAreLegal) {
  for (const IntegratorEntry& entry : integrators()) {
    Params p(all_params(entry));
    for (const ParamInfo& info : p.table())
      EXPECT_NO_THROW(p.set(info.id, info.default_text)) << entry.id << " " << info.id;
  }
}

TEST(Params, ErrorsNameParameterValueAndWhatIsAllowed) {
  Params p(all_params(*find_integrator("lightcuts")));
  EXPECT_NE(error_of(p, "errror", "1").find("\"errror\"; there are: vpls"), std::string::npos);
  EXPECT_NE(error_of(p, "error", "2").find("error: 2 is not in [0, 1]"), std::string::npos);
  EXPECT_NE(error_of(p, "error", "two").find("\"two\" is not a number"), std::string::npos);
  EXPECT_NE(error_of(p, "error", "0.1x").find("not a number"), std::string::npos);
  EXPECT_NE(error_of(p, "error", "nan").find("not a number"), std::string::npos);
  EXPECT_NE(error_of(p, "vpls", "1.5").find("whole number"), std::string::npos);
  EXPECT_NE(error_of(p, "tree", "oak").find("\"oak\" is not one of agglomerative|"), std::string::npos);
  EXPECT_EQ(p.real("error"), 0.02) << "a failed set changes nothing";
}

TEST(Registry, IdsAreUniqueAndEveryEntryTellsWhatItIs) {
  std::vector<std::string> ids;
  for (const IntegratorEntry& e : integrators()) {
    ids.emplace_back(e.id);
    EXPECT_NE(std::string(e.label), "");
    EXPECT_NE(std::string(e.description), "");
    EXPECT_NE(std::string(e.source), "");
    EXPECT_NE(e.create(), nullptr);
  }
  std::sort(ids.begin(), ids.end());
  EXPECT_EQ(std::adjacent_find(ids.begin(), ids.end()), ids.end());
  EXPECT_EQ(find_integrator("no such thing"), nullptr);
}

}  // namespace lumicut
