#include "tests/mapping/graph_data.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace swiftlet::test {
namespace {

namespace fs = std::filesystem;

fs::path graphFolder() {
  const char* given = std::getenv("SWIFTLET_DATA");
  const fs::path data = given != nullptr ? fs::path(given) : fs::path(SWIFTLET_SOURCE_DIR) / "../shared/data";
  return data / "pose_graphs";
}

}  // namespace

std::vector<GraphReference> readReferences() {
  // graph,dim,poses,edges,vertex_lines,non_psd_info_edges,best_cost_ceres,best_cost_g2o,...
  constexpr std::size_t kColumns = 8;
  std::vector<GraphReference> references;
  std::ifstream file(graphFolder() / "reference_costs.csv");
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::vector<std::string> fields;
    std::istringstream words(line);
    for (std::string field; fields.size() < kColumns && std::getline(words, field, ',');)
      fields.push_back(field);
    if (fields.size() < kColumns) continue;
    GraphReference reference;
    reference.name = fields[0];
    const fs::path plain = graphFolder() / (fields[0] + ".g2o");
    reference.path = fs::exists(plain) ? plain.string() : plain.string() + ".xz";
    reference.space = fields[1] == "3";
    reference.poses = std::stoul(fields[2]);
    reference.edges = std::stoul(fields[3]);
    reference.best_g2o = std::stod(fields[7]);
    references.push_back(reference);
  }
  return references;
}

}  // namespace swiftlet::test
