#include "mapping/place/bag_of_words.hpp"

#include <algorithm>

namespace swiftlet {

float similarity(const BagOfWords& a, const BagOfWords& b) {
  float sum = 0;
  const WordValue* i = a.begin();
  const WordValue* j = b.begin();
  while (i != a.end() && j != b.end()) {
    if (i->word == j->word) {
      sum += std::min(i->value, j->value);
      ++i;
      ++j;
    } else if (i->word < j->word) {
      ++i;
    } else {
      ++j;
    }
  }
  return sum;
}

}  // namespace swiftlet
