#pragma once
// The public pose graphs of the data folder and their best known costs; none where the folder is absent.

#include <string>
#include <vector>

namespace swiftlet::test {

struct GraphReference {
  std::string name;
  std::string path;
  std::size_t poses = 0;
  std::size_t edges = 0;
  double best_g2o = 0;  ///< 1/2 sum e^T Omega e, g2o's error
  bool space = false;
};

/// In the order of reference_costs.csv, from SWIFTLET_DATA/pose_graphs.
std::vector<GraphReference> readReferences();

}  // namespace swiftlet::test
