// The picture of a confusion matrix says what the matrix holds.

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/evaluation/confusion_picture.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

using namespace swiftlet;

namespace {

std::size_t countOf(const std::string& text, const std::string& what) {
  std::size_t count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

}  // namespace

TEST_CASE("each class has a row of shares, with what was found as another class or not at all") {
  LabelConfusion labels;
  for (int i = 0; i < 75; ++i) labels.add(1, 1);
  for (int i = 0; i < 20; ++i) labels.add(1, 2);
  for (int i = 0; i < 5; ++i) labels.add(1, 0);
  for (int i = 0; i < 60; ++i) labels.add(2, 2);
  for (int i = 0; i < 40; ++i) labels.add(2, 9);  // a class that nothing is
  const std::string svg = confusionSvg(labels, {{1, "floor"}, {2, "pipes & <wires>"}});
  CHECK(countOf(svg, "<rect") == 1 + 2 * 4);
  CHECK(countOf(svg, ">75.0<") == 1);
  CHECK(countOf(svg, ">20.0<") == 1);
  CHECK(countOf(svg, ">5.0<") == 1);
  CHECK(countOf(svg, ">60.0<") == 1);
  CHECK(countOf(svg, ">40.0<") == 1);
  CHECK(countOf(svg, ">floor<") == 2);
  CHECK(countOf(svg, ">pipes &amp; &lt;wires&gt;<") == 2);
  CHECK(svg.find("accuracy 67.5 %") != std::string::npos);
  CHECK(svg.ends_with("</svg>"));
}

TEST_CASE("names of labels are read; a bad line is named") {
  const ScratchFolder folder("labels");
  CHECK(readLabelNames(folder.file("")).empty());
  std::filesystem::create_directories(folder.file("mav0/labels0"));
  const std::string path = folder.file("mav0/labels0/labels.csv");
  std::ofstream(path) << "#id,name\n0,unknown\n3,wall\r\n";
  const auto names = readLabelNames(folder.file(""));
  CHECK(names.size() == 2);
  CHECK(names.at(3) == "wall");
  for (const char* bad : {"x,wall", "3", "3,", "-1,wall", "3;wall"}) {
    std::ofstream(path) << "#id,name\n0,unknown\n" << bad << "\n";
    CHECK_THROWS_WITH(readLabelNames(folder.file("")), Catch::Contains("labels.csv:3"));
  }
}
