"""Choices where the paper leaves one open, or prints otherwise than it can be meant."""

LEDGER = "`docs/equations.md`"

CHOICES = (
    "**Eq. 3 or Eq. 4.** The paper joins the two by an 'or', but with L = D - C they differ by the "
    "degree of each vertex. The streams here use Eq. 3, L = I - D^-1 C; `gft` finds its "
    f"frequencies from D - C, which is symmetric ({LEDGER}, Eq. 3).",
    "**The n_b^2 of Eq. 13.** It makes q_d of n_b blocks as large as that of one k x k "
    "dictionary. What is stored grows with n_b. q_s holds q_d as printed, the column 'q_d as "
    "stored' is with n_b; both with the mean bits of an entry in the stream for `blocks`, 16 bits "
    f"for all others ({LEDGER}, Eq. 13).",
    "**One coordinate of three.** The paper's q_d = 16 k / n is one k x k dictionary, and so its "
    "count is of one coordinate matrix, without connectivity. q is a third of the bits of all "
    "coefficients; q_a and q_d are the formulas of Eq. 13. The column 'bpvf of the file' has 8 "
    "times all bytes by vertices and frames: three coordinates, connectivity, order, headers. "
    "Dictionaries are stored with k_l columns of the k that Eq. 13 counts.",
    "**Anchors.** The paper prints q_a = 16 n_c / n for v2v, too. Decoding by a product uses none "
    "and none are sent, so it stands as '-' here. For n = 9971 it prints 0.1595, which is of 99.4 "
    "anchors; here they are a whole number, rounded up.",
    "**NMSVE.** The paper gives no normalisation. Positions are divided by the diagonal of the "
    "first frame's bounding box, and a frame's error by 2 n: the figures compare with each other, "
    f"not with the axis of the paper's Fig. 4 ({LEDGER}).",
    "**Decoding without anchors.** L of Eq. 11 has no inverse: constants on a component are in "
    "its kernel. `pca` and `pca-q` carry one vertex of each component, which fixes its "
    f"translation, and nothing else ({LEDGER}, Eq. 11).",
    "**What Q is.** Eq. 10 leaves it open. One step serves all rows, such that the largest "
    "coefficient takes the given bits; the coefficients are entropy-coded, so that q is what they "
    f"take in the file and not the given bits ({LEDGER}, Eq. 10).",
    "**k_l and bits.** The paper prints neither for its tables. Taken are 20 rows, beyond which "
    "it finds its Fig. 3 not to get better, and 8 bits, 16 for `pca`. `v2v` has 11 bits and "
    "`blocks` 4 rows in each block, so that their q stand to that of `pca-q` about as they do in "
    "its Table I. So q beside q says little; errors at equal rate are in the diagrams of rate and "
    "distortion.",
    "**Per mesh.** `gft` takes the low graph frequencies of every frame. L is the same for all "
    "frames, so one decomposition serves all; the paper does one for each.",
)
