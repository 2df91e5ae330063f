// The results of `lumicut bench` as tables, laid out like those of the thesis.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace lumicut::tools {

struct Table {
  std::string title, note;
  std::vector<std::string> header;
  // Rows of one cell are the headings of blocks.
  std::vector<std::vector<std::string>> rows;
};

// One table a number of samples and of lights: a column a scene, a block of rows a method [thesis Tables 2.4, 2.6, 3.1,
// 3.3, 3.5]; then, where scenes were lit by several numbers of lights, how seconds, memory and error grow with them
// [Fig. 3.9, Table 3.4]. `results` as docs/benchmarking.md describes them.
std::vector<Table> bench_tables(const nlohmann::ordered_json& results);

std::string to_text(const std::vector<Table>& tables);
std::string to_markdown(const std::vector<Table>& tables);

// Values of `key` over rows (such as seeds): their mean, and whether there are any.
bool mean_of(const std::vector<const nlohmann::ordered_json*>& rows, const std::string& key, double& mean);
// Rows that were run to their end.
std::vector<const nlohmann::ordered_json*> complete_rows(const nlohmann::ordered_json& results);

}  // namespace lumicut::tools
