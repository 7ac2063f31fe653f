// The tree of words: files, training, words and bags.

#include <bit>
#include <catch2/catch.hpp>
#include <memory>

#include "drivers/input/input_error.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"
#include "mapping/place/hamming.hpp"
#include "mapping/place/vocabulary_training.hpp"
#include "tests/support/input_error.hpp"

using namespace swiftlet;

namespace {

Descriptor draw(Random& random) {
  Descriptor d;
  for (std::uint64_t& word : d.words) word = static_cast<std::uint64_t>(random.next()) << 32U | random.next();
  return d;
}

Descriptor disturbed(Descriptor d, int bits, Random& random) {
  for (int i = 0; i < bits; ++i) {
    const std::uint32_t bit = random.below(256);
    d.words[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return d;
}

/// 40 images of 50 features drawn around 64 centres; the first centres are in all images.
struct Training {
  std::vector<Descriptor> centres, descriptors;
  std::vector<std::size_t> ends;
  Training() {
    Random random(11);
    for (int i = 0; i < 64; ++i) centres.push_back(draw(random));
    for (std::uint32_t image = 0; image < 40; ++image) {
      for (std::uint32_t f = 0; f < 50; ++f) {
        const std::uint32_t centre = f < 8 ? f : 8 + (image * 7 + random.below(12)) % 56;
        descriptors.push_back(disturbed(centres[centre], 12, random));
      }
      ends.push_back(descriptors.size());
    }
  }
};

constexpr const char* kText =
    "2 2 0 0\n"
    "0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n"
    "0 1 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 255 "
    "255 255 "
    "255 255 255 255 255 0.5\n"
    "1 1 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1.25\n"
    "1 1 15 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 2.5\n\n";

}  // namespace

TEST_CASE("Training finds the clusters that the descriptors were drawn from, and the same ones again") {
  const Training data;
  VocabularyTraining settings;
  settings.branching = 8;
  settings.depth = 2;
  Vocabulary vocabulary, again;
  REQUIRE(trainVocabulary(data.descriptors, data.ends, settings, vocabulary).ok());
  REQUIRE(trainVocabulary(data.descriptors, data.ends, settings, again).ok());
  CHECK(vocabulary.compact() == again.compact());
  CHECK(vocabulary.words() >= 48);
  Random random(12);
  int same = 0;
  constexpr int kTries = 400;
  for (int i = 0; i < kTries; ++i) {
    const Descriptor& centre = data.centres[random.below(64)];
    same += vocabulary.word(disturbed(centre, 10, random)) == vocabulary.word(disturbed(centre, 10, random))
                ? 1
                : 0;
  }
  CHECK(same > 0.9 * kTries);
  // A word of every image says nothing; one of few images says more.
  CHECK(vocabulary.weight(vocabulary.word(data.centres[0])) < 0.1F);
  CHECK(vocabulary.weight(vocabulary.word(data.centres[30])) > 0.5F);
}

TEST_CASE("Training refuses what makes no sense") {
  const Training data;
  Vocabulary vocabulary;
  VocabularyTraining settings;
  settings.branching = 1;
  CHECK(trainVocabulary(data.descriptors, data.ends, settings, vocabulary).code == StatusCode::kInvalidInput);
  settings = {};
  CHECK(trainVocabulary({}, {}, settings, vocabulary).code == StatusCode::kDegenerate);
  const std::vector<std::size_t> short_ends = {5};
  CHECK(trainVocabulary(data.descriptors, short_ends, settings, vocabulary).code ==
        StatusCode::kInvalidInput);
  // All descriptors alike: one word.
  const std::vector<Descriptor> alike(20, data.centres[0]);
  const std::vector<std::size_t> one = {20};
  REQUIRE(trainVocabulary(alike, one, settings, vocabulary).ok());
  CHECK(vocabulary.words() == 1);
}

TEST_CASE("The compact form gives the same vocabulary; any damage is found") {
  const Training data;
  VocabularyTraining settings;
  settings.branching = 4;
  settings.depth = 3;
  Vocabulary vocabulary, copy;
  REQUIRE(trainVocabulary(data.descriptors, data.ends, settings, vocabulary).ok());
  const std::vector<std::uint8_t> bytes = vocabulary.compact();
  REQUIRE(copy.load(bytes).ok());
  CHECK(copy.words() == vocabulary.words());
  CHECK(copy.depth() == vocabulary.depth());
  for (const Descriptor& d : data.descriptors) {
    REQUIRE(copy.word(d) == vocabulary.word(d));
    REQUIRE(copy.weight(copy.word(d)) == vocabulary.weight(vocabulary.word(d)));
  }
  Random random(13);
  for (int i = 0; i < 200; ++i) {
    std::vector<std::uint8_t> damaged = bytes;
    damaged[random.below(static_cast<std::uint32_t>(damaged.size()))] ^=
        static_cast<std::uint8_t>(1 + random.below(255));
    CHECK(copy.load(damaged).code == StatusCode::kInvalidInput);
    CHECK(copy.words() == 0);
    damaged = bytes;
    damaged.resize(random.below(static_cast<std::uint32_t>(bytes.size())));
    CHECK(copy.load(damaged).code == StatusCode::kInvalidInput);
  }
}

TEST_CASE("The shipped vocabulary is there") {
  const Vocabulary& shipped = Vocabulary::shipped();
  CHECK(shipped.words() > 1000);
  CHECK(shipped.compact().size() < 1'000'000);
}

TEST_CASE("ORB-SLAM's text is read, with the parent-child distances deciding the word") {
  const Vocabulary vocabulary = readVocabularyBytes("voc.txt", kText);
  CHECK(vocabulary.words() == 3);
  CHECK(vocabulary.nodes() == 4);
  CHECK(vocabulary.depth() == 2);
  Descriptor d;
  CHECK(vocabulary.weight(vocabulary.word(d)) == 1.25F);
  d.words[0] = 0xF;
  CHECK(vocabulary.weight(vocabulary.word(d)) == 2.5F);
  d.words = {~0ULL, ~0ULL, ~0ULL, 0};
  CHECK(vocabulary.weight(vocabulary.word(d)) == 0.5F);
}

TEST_CASE("Bad vocabulary texts are refused with line and field") {
  const auto refusal = [](std::string text) {
    return test::messageOf([&] { (void)readVocabularyBytes("voc.txt", text); });
  };
  const std::string good = kText;
  CHECK(refusal(good).empty());
  CHECK_THAT(refusal(""), Catch::Contains("empty"));
  CHECK_THAT(refusal("1 2 0 0\n"), Catch::Contains("voc.txt:1: branching"));
  CHECK_THAT(refusal("10 6 0 9\n"), Catch::Contains("voc.txt:1: weighting"));
  CHECK_THAT(refusal(good + "9 1 1\n"), Catch::Contains("voc.txt:7: parent"));
  CHECK_THAT(refusal(good + "2 1 1\n"), Catch::Contains("is a leaf"));
  CHECK_THAT(refusal(good + "1 1 1 256\n"), Catch::Contains("voc.txt:7: descriptor"));
  CHECK_THAT(refusal(good.substr(0, good.find("1.25")) + "nan\n"), Catch::Contains("voc.txt:4: weight"));
  CHECK_THAT(refusal("2 2 0 0\n"), Catch::Contains("has no nodes"));
  std::string no_leaf = good;
  no_leaf[no_leaf.find("0 1 255") + 2] = '0';
  CHECK_THAT(refusal(no_leaf), Catch::Contains("is not a leaf and has no children"));
}

TEST_CASE("DBoW2's YAML is read, in any order") {
  std::string zeros, ones;
  for (int i = 0; i < 32; ++i) {
    zeros += "0 ";
    ones += "255 ";
  }
  const std::string text =
      "%YAML:1.0\n---\nvocabulary:\n   k: 9\n   L: 3\n   nodes:\n      - { nodeId:2, parentId:0, "
      "weight:3.5,\n"
      "          descriptor:\"" +
      ones + "\" }\n      - { nodeId:1, parentId:0, weight:1.,\n          descriptor:\"" + zeros +
      "\" }\n   words:\n      - { wordId:0, nodeId:1 }\n      - { wordId:1, nodeId:2 }\n";
  const Vocabulary vocabulary = readVocabularyBytes("voc.yml", text);
  CHECK(vocabulary.words() == 2);
  Descriptor d;
  CHECK(vocabulary.weight(vocabulary.word(d)) == 1.0F);
  d.words = {~0ULL, ~0ULL, ~0ULL, ~0ULL};
  CHECK(vocabulary.weight(vocabulary.word(d)) == 3.5F);
  const auto refused = [](const std::string& bad) { return Catch::Contains(bad); };
  std::string bad = text;
  bad.replace(bad.find("nodeId:2"), 8, "nodeId:5");
  CHECK_THROWS_WITH(readVocabularyBytes("voc.yml", bad), refused("without gaps"));
  bad = text;
  bad.replace(bad.find("255 "), 4, "256 ");
  CHECK_THROWS_WITH(readVocabularyBytes("voc.yml", bad), refused("voc.yml:7: descriptor"));
  bad = text;
  bad.replace(bad.find("parentId:0"), 10, "parentId:2");
  CHECK_THROWS_WITH(readVocabularyBytes("voc.yml", bad), refused("words"));
  CHECK_THROWS_WITH(readVocabularyBytes("voc.yml.gz", std::string("\x1f\x8b\x08") + text),
                    refused("cannot be decompressed"));
}

TEST_CASE("Compressed YAML and the compact form are read from files") {
  const std::string folder = SWIFTLET_SOURCE_ROOT "/tests/fuzz/corpus/vocabulary/";
  const Vocabulary packed = readVocabulary(folder + "dbow2.yml.gz");
  CHECK(packed.words() == 3);
  CHECK(packed.compact() == readVocabulary(folder + "dbow2.yml").compact());
  CHECK(readVocabulary(folder + "compact.swv").compact() == readVocabulary(folder + "orbvoc.txt").compact());
  CHECK_THROWS_AS(readVocabulary(folder + "absent"), InputError);
}

TEST_CASE("Lists of nodes that are no tree are refused") {
  Vocabulary vocabulary;
  std::vector<VocabularyNode> nodes(3);
  nodes[1].parent = 3;
  nodes[2].parent = 2;  // 2 and 3 are each other's
  CHECK(vocabulary.assemble(nodes).code == StatusCode::kInvalidInput);
  nodes[1].parent = 4;
  CHECK(vocabulary.assemble(nodes).code == StatusCode::kInvalidInput);
  nodes[1].parent = 1;
  CHECK(vocabulary.assemble(nodes).ok());
  nodes[2].weight = -1;
  CHECK(vocabulary.assemble(nodes).code == StatusCode::kInvalidInput);
  CHECK(vocabulary.words() == 0);
  std::vector<VocabularyNode> chain(Vocabulary::kMaxDepth + 1);
  for (std::size_t i = 0; i < chain.size(); ++i) chain[i].parent = static_cast<std::uint32_t>(i);
  CHECK(vocabulary.assemble(chain).code == StatusCode::kInvalidInput);
  chain.pop_back();
  CHECK(vocabulary.assemble(chain).ok());
}

TEST_CASE("Bags of words and their similarity") {
  const Vocabulary vocabulary = readVocabularyBytes("voc.txt", kText);
  auto keyframe = std::make_unique<PlaceKeyframe>();
  auto a = std::make_unique<BagOfWords>(), b = std::make_unique<BagOfWords>();
  PlaceFeature f;
  REQUIRE(keyframe->features.tryPushBack(f));  // weight 1.25
  f.descriptor.words[0] = 0xF;
  REQUIRE(keyframe->features.tryPushBack(f));  // 2.5
  REQUIRE(keyframe->features.tryPushBack(f));
  REQUIRE(vocabulary.describe(*keyframe, *a).ok());
  REQUIRE(a->size() == 2);
  CHECK((*a)[0].value == Approx(0.2));
  CHECK((*a)[1].value == Approx(0.8));
  CHECK(similarity(*a, *a) == Approx(1.0));
  keyframe->features.clear();
  f.descriptor.words = {~0ULL, ~0ULL, ~0ULL, ~0ULL};
  REQUIRE(keyframe->features.tryPushBack(f));  // 0.5
  f.descriptor = {};
  REQUIRE(keyframe->features.tryPushBack(f));  // 1.25
  REQUIRE(vocabulary.describe(*keyframe, *b).ok());
  // L1 by definition: 1 - |a - b| / 2.
  const double norm = std::abs(0.2 - 1.25 / 1.75) + 0.8 + 0.5 / 1.75;
  CHECK(similarity(*a, *b) == Approx(1 - 0.5 * norm));
  Vocabulary none;
  CHECK(none.describe(*keyframe, *b).code == StatusCode::kNotReady);
  CHECK(b->empty());
}
