// Runs every target over its corpus and over seeded mutations of it, with any compiler:
//   corpus_main CORPUS_FOLDER [MUTATIONS_PER_FILE]
// A defect ends the program (abort, sanitizer, uncaught exception); the input is named before it runs
// when SWIFTLET_FUZZ_VERBOSE is set.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "estimator/core/random.hpp"
#include "tests/fuzz/fuzz_targets.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr int kDefaultMutations = 200;

std::vector<fs::path> filesIn(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

std::size_t place(Random& random, const std::string& text) {
  return random.below(static_cast<std::uint32_t>(text.size() + 1));
}

void mutate(Random& random, std::string& text) {
  static const std::vector<std::string> kWords = {
      "nan", "inf", "-",  ",", "\n", "\r", "#", "1e999", "[", "]", "{", ":", "9223372036854775808",
      "&a",  "*a",  "!!", "|", "\t", " ",  ".", "0"};
  const std::size_t at = place(random, text);
  switch (random.below(5)) {
    case 0:
      if (at < text.size()) text[at] = static_cast<char>(random.below(256));
      break;
    case 1:
      text.erase(at, random.below(20));
      break;
    case 2:
      text.insert(at, kWords[random.below(static_cast<std::uint32_t>(kWords.size()))]);
      break;
    case 3:
      text.insert(place(random, text), text.substr(at, random.below(60)));
      break;
    default:
      text.resize(at);
      break;
  }
}

int run(const fs::path& corpus, int mutations) {
  const bool verbose = std::getenv("SWIFTLET_FUZZ_VERBOSE") != nullptr;
  for (const NamedTarget& target : targets()) {
    std::size_t inputs = 0;
    for (const fs::path& file : filesIn(corpus / target.name)) {
      const std::string original = test::textOf(file);
      target.run(original);
      Random random(original.size(), inputs);
      for (int i = 0; i < mutations; ++i) {
        std::string text = original;
        const std::uint32_t edits = 1 + random.below(4);
        for (std::uint32_t k = 0; k < edits; ++k) mutate(random, text);
        if (verbose) std::fprintf(stderr, "%s %s %d\n", target.name, file.c_str(), i);
        target.run(text);
      }
      inputs += 1 + static_cast<std::size_t>(mutations);
    }
    std::printf("%s: %zu inputs\n", target.name, inputs);
    if (inputs == 0) return 1;
  }
  return 0;
}

}  // namespace
}  // namespace swiftlet::fuzz

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s CORPUS_FOLDER [MUTATIONS_PER_FILE]\n", argv[0]);
    return 2;
  }
  const int mutations = argc > 2 ? std::atoi(argv[2]) : swiftlet::fuzz::kDefaultMutations;
  return swiftlet::fuzz::run(argv[1], mutations);
}
