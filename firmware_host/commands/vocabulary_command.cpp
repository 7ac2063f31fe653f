#include <fmt/format.h>

#include <memory>

#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"
#include "firmware_host/lab/modules/vocabulary_images.hpp"
#include "mapping/place/place_extractor.hpp"
#include "mapping/place/vocabulary_training.hpp"

namespace swiftlet {
namespace {

struct VocabularyOptions {
  std::vector<std::string> train;
  std::string read;
  std::string out;
  VocabularyTraining training;
  int every = 1;
  int features = PlaceExtractorSettings{}.features;
};

Vocabulary obtain(const VocabularyOptions& options) {
  if (!options.read.empty()) return readVocabulary(options.read);
  if (options.train.empty()) return Vocabulary::shipped();
  const TrainingImages images = describeImages(options.train, options.every, options.features);
  fmt::print("{} descriptors of {} images\n", images.descriptors.size(), images.ends.size());
  Vocabulary vocabulary;
  const Status status = trainVocabulary(images.descriptors, images.ends, options.training, vocabulary);
  if (!status.ok()) throw InputError("--train", 0, "", status.what, "Give folders of images with texture");
  return vocabulary;
}

int vocabulary(const VocabularyOptions& options) {
  const Vocabulary words = obtain(options);
  fmt::print("{} words, {} nodes, {} levels\n", words.words(), words.nodes(), words.depth());
  if (options.out.empty()) return kExitDone;
  writeVocabulary(options.out, words);
  fmt::print("written to {}\n", options.out);
  return kExitDone;
}

}  // namespace

void addVocabularyCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("vocabulary", "Train, convert or describe a vocabulary for place recognition");
  auto options = std::make_shared<VocabularyOptions>();
  auto* train =
      command->add_option("--train", options->train, "Folders of images to train a vocabulary from");
  command->add_option("--read", options->read, "A vocabulary: compact, ORBvoc.txt, or DBoW2 YAML (.gz)")
      ->excludes(train);
  command->add_option("--out", options->out, "File to write, in compact form");
  command->add_option("--branching", options->training.branching, "Children per node")
      ->check(CLI::Range(2, static_cast<int>(Vocabulary::kMaxChildren)))
      ->capture_default_str();
  command->add_option("--levels", options->training.depth, "Levels of the tree")
      ->check(CLI::Range(1, Vocabulary::kMaxDepth))
      ->capture_default_str();
  command->add_option("--seed", options->training.seed, "Seed of the clustering")->capture_default_str();
  command->add_option("--every", options->every, "Use only every n-th image of a folder")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->footer(
      "Without --train or --read, the built-in vocabulary is described.\n"
      "Example:\n"
      "  swiftlet vocabulary --train data/flight_a/mav0/cam0 data/flight_b/mav0/cam0 --every 5 --out "
      "places.swv\n"
      "  swiftlet vocabulary --read ORBvoc.txt --out orbvoc.swv");
  command->callback([options, &exit_code] { exit_code = vocabulary(*options); });
}

}  // namespace swiftlet
