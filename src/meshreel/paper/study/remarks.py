"""Choices where the paper leaves one open, or contradicts itself."""

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
    "count is of one coordinate matrix, without connectivity. q and q_a are a third of the bits "
    "that all coefficients and anchors take in the stream; q_d is the formula of Eq. 13. The "
    "column 'bpvf of the file' is 8 times all bytes over vertices and frames: three coordinates, "
    "connectivity, order, headers. Dictionaries are stored with k_l columns of the k that Eq. 13 "
    "counts.",
    "**Anchors.** Eq. 12 has the positions of the anchors in all frames, and Table I counts 16 "
    "bits for each. They are sent so, predicted from the modes, with 4 bits more than the deltas "
    "have; the column 'q_a at 16 bits' has the paper's count. The paper prints q_a for v2v, too: "
    "decoding by a product uses no anchors and none are sent, so '-' stands here. For n = 9971 it "
    "prints 0.1595, which is 99.4 anchors; here their number is rounded up.",
    "**Variant (ii)** is worded as the projection of quantized deltas, while Eq. 10 quantizes "
    "projected deltas. `pca-q` follows Eq. 10; `pca-q (quantized deltas)` is the other reading, "
    "which sends its projections at 16 bits.",
    "**NMSVE.** The paper gives no normalisation. Positions are divided by the diagonal of the "
    "first frame's bounding box, and a frame's error by 2 n: the figures compare with each other, "
    f"not with the axis of the paper's Fig. 4 ({LEDGER}).",
    "**Decoding without anchors.** L of Eq. 11 has no inverse: constants on a component are in "
    "its kernel. `pca` and `pca-q` carry one vertex of each component, which fixes its "
    f"translation, and nothing else ({LEDGER}, Eq. 11).",
    "**What Q is.** Eq. 10 leaves it open. One step serves all rows, such that the largest "
    "coefficient takes the given bits; the coefficients are entropy-coded, so that q is what they "
    f"take in the file and not the given bits ({LEDGER}, Eq. 10).",
    "**k_l and bits.** The paper prints neither for its tables. The default is 20 rows, beyond "
    "which its Fig. 3 shows no improvement, and 8 bits, 16 for `pca`; 11 bits for `v2v`, a "
    "compromise between KG and STED, and 4 rows in each block of `blocks`. Comparing q with q "
    "therefore says little; the rate-distortion diagrams have errors at equal rate. Without "
    "entropy coding its Samba rates are nearly 8 rows at 16 and at 4 bits: `--preset printed`.",
    "**Per mesh.** `gft` takes the low graph frequencies of every frame. L is the same for all "
    "frames, so one decomposition serves all; the paper does one for each.",
)
