// The file of map.confusion: what it changes in the labels of the map, and what is refused.

#include <catch2/catch.hpp>
#include <fstream>

#include "drivers/input/input_error.hpp"
#include "firmware_host/settings/confusion_file.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

using namespace swiftlet;

namespace {

LabelCounts counts(int threes, int fours) {
  LabelCounts result;
  for (int i = 0; i < threes; ++i) result.add(3);
  for (int i = 0; i < fours; ++i) result.add(4);
  return result;
}

}  // namespace

TEST_CASE("a network that often says 3 for 4 is believed less where it says 3") {
  const ScratchFolder folder("confusion");
  const std::string path = folder.file("confusion.csv");
  std::ofstream(path) << "# true,said,probability\n4,4,0.6\n4,3,0.4\r\n3,3,0.99\n3,4,0.01\n\n";
  const ConfusionModel model = readConfusion(path, 0.9F);
  const ConfusionModel plain(kLabelValues, 0.9F);
  // Three times 3, twice 4: 3 were right once in a hundred times for each 4.
  CHECK(plain.estimate(counts(3, 2)).label == 3);
  CHECK(model.estimate(counts(3, 2)).label == 4);
  CHECK(model.estimate(counts(5, 0)).label == 3);
  // Labels that are not listed are as map.label_certainty says.
  LabelCounts seven;
  seven.add(7);
  CHECK(model.estimate(seven).label == 7);
}

TEST_CASE("lines that say nothing sensible are refused with line and field") {
  const ScratchFolder folder("confusion");
  const std::string path = folder.file("confusion.csv");
  const auto refused = [&](const char* text, const char* where) {
    std::ofstream(path) << "#\n" << text;
    CHECK_THROWS_WITH(readConfusion(path, 0.9F), Catch::Contains(where));
  };
  refused("0,3,1\n", "csv:2: true");
  refused("32,3,1\n", "csv:2: true");
  refused("3,x,1\n", "csv:2: said");
  refused("3,3\n", "csv:2: said");
  refused("3,3,1.5\n", "csv:2: probability");
  refused("3,3,nan\n", "csv:2: probability");
  refused("3,3,0.5,1\n", "csv:2: probability");
  refused("3,3,0.5\n3,3,0.5\n", "csv:3: said");
  refused("5,5,1\n3,3,0.5\n3,4,0.4\n", "csv:3: probability");
  CHECK_THROWS_AS(readConfusion(folder.file("none.csv"), 0.9F), InputError);
}
