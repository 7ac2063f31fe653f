#pragma once
// Vocabulary files: the project's compact form (mapping/place/vocabulary.hpp), ORB-SLAM's text (ORBvoc.txt)
// and DBoW2's YAML, plain or compressed by gzip, recognized by content.
//
// Weights are used as in the file. Descriptor bits depend on the comparisons that produced them: a vocabulary
// of ORB descriptors also divides swiftlet's descriptors into words, but was not trained on them.
//
// Host side: allocates, throws InputError that names file, line and field.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "mapping/place/vocabulary.hpp"

namespace swiftlet {

Vocabulary readVocabulary(const std::string& path);
/// `name`: the file's name in messages. `bytes`: the file's content.
Vocabulary readVocabularyBytes(const std::string& name, std::string_view bytes);

/// Writes the compact form.
void writeVocabulary(const std::string& path, const Vocabulary& vocabulary);

/// Format: a line "k L scoring weighting", then a line "parent isLeaf d0 .. d31 weight" for each node, with
/// ids 1, 2, ...
std::vector<VocabularyNode> readVocabularyText(const std::string& name, std::string_view text);
/// Format: "{ nodeId, parentId, weight, descriptor }" for each node in any order, and "{ wordId, nodeId }"
/// for each leaf.
std::vector<VocabularyNode> readVocabularyYaml(const std::string& name, std::string_view text);

}  // namespace swiftlet
