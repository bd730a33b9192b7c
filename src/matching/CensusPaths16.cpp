#include "ByteVector16.hpp"
#include "CensusPathsLoops.hpp"

namespace disparity_refinement {

const CensusPathsFunctions& censusPaths16() { return CensusPathsDispatch<ByteVector16>::FUNCTIONS; }

}  // namespace disparity_refinement
