from meshreel.metrics.rate import rate_bpvf


def test_rate_is_in_bits_per_vertex_and_frame():
    assert rate_bpvf(1000, 20, 50) == 8  # 8000 bits over 20 * 50
