#include <gtest/gtest.h>

#include "core/error.h"
#include "core/number_text.h"
#include "integrators/integrator.h"
#include "tests/support/params.h"

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

// Of all members, as text.
static std::vector<std::string> members(const Params& p) {
  std::vector<std::string> texts;
  for (const Param& info : p.table()) texts.push_back(info.text(p.values(), info));
  return texts;
}

TEST(Params, EveryDefaultParsesToTheStructsDefault) {
  for (const IntegratorEntry& entry : integrators()) {
    Params p(all_params(entry));
    const auto defaults = members(p);
    for (const ParamInfo& info : p.table()) {
      EXPECT_EQ(*p.text(info.id), info.default_text);
      p.set(info.id, info.default_text);
    }
    EXPECT_EQ(members(p), defaults) << entry.id;
    EXPECT_EQ(p.common(), CommonParams{});
  }
}

TEST(Params, EachSetsItsOwnMemberAlone) {
  for (const IntegratorEntry& entry : integrators()) {
    const Params defaults(all_params(entry));
    for (size_t i = 0; i < defaults.table().size(); ++i) {
      const ParamInfo& info = defaults.table()[i];
      Params p = defaults;
      p.set(info.id, test::another_value(info));
      auto expected = members(defaults), got = members(p);
      EXPECT_NE(got[i], expected[i]) << entry.id << " " << info.id;
      got[i] = expected[i];
      EXPECT_EQ(got, expected) << entry.id << " " << info.id;
    }
  }
}

TEST(Params, ChoicesAreTheEnumeratorsInTheirOrder) {
  Params p(all_params(*find_integrator("lightcuts")));
  p.set("virtual_lights", "spheres");
  EXPECT_EQ(p.common().virtual_lights, VirtualLights::spheres);
  p.set("compensate", "on");
  EXPECT_TRUE(p.common().compensate);
  EXPECT_EQ(*p.text("compensate"), "1");
  EXPECT_EQ(*p.text("virtual_lights"), "spheres");
}

TEST(Params, ErrorsNameParameterValueAndWhatIsAllowed) {
  for (const IntegratorEntry& entry : integrators()) {
    Params p(all_params(entry));
    const auto before = members(p);
    for (const ParamInfo& info : p.table()) {
      const auto refused = [&](const std::string& value, const std::string& why) {
        EXPECT_EQ(error_of(p, info.id, value.c_str()), std::string("parameter ") + info.id + ": " + why);
      };
      if (info.type == ParamType::choice) {
        refused("oak", std::string("\"oak\" is not one of ") + info.choices);
        refused(info.choices, std::string("\"") + info.choices + "\" is not one of " + info.choices);
        refused("", std::string("\"\" is not one of ") + info.choices);
      } else if (info.type == ParamType::boolean) {
        refused("2", "\"2\" is neither true nor false");
      } else {
        const std::string range = " is not in [" + number_text(info.minimum) + ", " + number_text(info.maximum) + "]";
        for (const std::string& value : {std::string("-1"), std::string("1e+38")}) refused(value, value + range);
        for (const char* value : {"two", "0.1x", "nan", "inf", ""})
          refused(value, std::string("\"") + value + "\" is not a number");
        if (info.type == ParamType::integer) refused("1.5", "1.5 is not a whole number");
      }
    }
    EXPECT_EQ(members(p), before) << "a failed set changes nothing";
    EXPECT_NE(error_of(p, "errror", "1").find("\"errror\"; there are: vpls, seed, max_depth"), std::string::npos);
  }
}

TEST(Params, WithOtherCommonOnesTextsFollow) {
  Params p(all_params(*find_integrator("lightcuts")));
  p.set("error", "0.10"), p.set("direct_share", "0.50");
  CommonParams common = p.common();
  common.seed = 4000000000u, common.clamp_distance = 0.125;
  const Params other = p.with(common);
  EXPECT_EQ(*other.text("seed"), "4000000000");
  EXPECT_EQ(*other.text("clamp_distance"), "0.125");
  EXPECT_EQ(*other.text("error"), "0.10") << "as it was set";
  EXPECT_EQ(*other.text("direct_share"), "0.50");
  EXPECT_EQ(*p.text("seed"), "1");
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

// Traits, files and the command's help are found by it.
TEST(Registry, IdsAreTheNamesOfTheList) {
  size_t i = 0;
#define LUMICUT_INTEGRATOR(name, ...) EXPECT_STREQ(integrators()[i++].id, #name);
#include "integrators/integrator_list.inc"
#undef LUMICUT_INTEGRATOR
  EXPECT_EQ(i, integrators().size());
}

}  // namespace lumicut
