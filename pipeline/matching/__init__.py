"""Motion matching: new motion from recorded frames, played on and joined where they are alike."""

from typing import Final

# Of what databases hold. 2: floors are level, how long a body is in the air; 3: the longest flights of a class;
# 4: limbs are even and nearest to the recorded joints, a foot that is lifted does not stand; 5: nor is one lifted above
# a foot that swings, and no joint is turned by half within a frame; 6: what it costs to begin in each recording.
DATABASE_VERSION: Final = 6
