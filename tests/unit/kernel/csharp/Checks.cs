// Checks of the binding beside decoded values: `Checks FILE SEGMENTS INTEGERS` prints "passed" or fails with the reason.

using System;
using System.IO;
using System.Linq;
using System.Threading.Tasks;
using Meshreel;

internal static class Checks
{
    private struct WithReference
    {
        public float X, Y;
        public string Text;
    }

    private sealed class Failing : MemoryStream
    {
        internal bool Fails, IsDisposed;
        internal Failing(byte[] bytes) : base(bytes) { }

        public override int Read(byte[] buffer, int offset, int count)
        {
            return Fails ? throw new IOException("the disk is gone") : base.Read(buffer, offset, count);
        }

        protected override void Dispose(bool disposing)
        {
            IsDisposed = true;
            base.Dispose(disposing);
        }
    }

    private static int Main(string[] words)
    {
        byte[] bytes = File.ReadAllBytes(words[0]);
        StreamsMayFail(bytes);
        MemoryIsLimited(bytes);
        WrongArgumentsAreRefused(File.ReadAllBytes(words[2]));
        OrderOfDisposalIsFree(bytes, words[1]);
        ThreadsShareAFile(bytes);
        TheCollectorReleasesWhatIsForgotten(bytes);
        SegmentsMustBeOpened(words[1]);
        FramesNeedNoManagedMemory(bytes);
        Console.WriteLine("passed");
        return 0;
    }

    private static void Need(bool holds, string what)
    {
        if (!holds)
        {
            throw new Exception("broken: " + what);
        }
    }

    private static T Throws<T>(Action action) where T : Exception
    {
        try
        {
            action();
        }
        catch (T expected)
        {
            return expected;
        }
        throw new Exception("broken: no " + typeof(T).Name);
    }

    private static void StreamsMayFail(byte[] bytes)
    {
        var stream = new Failing(bytes);
        using (ReelFile file = ReelFile.Open(stream))
        using (var decoder = new ReelDecoder(file))
        {
            stream.Fails = true;
            ReelException failure = Throws<ReelException>(() => decoder.Frames<float>(0, 0, 1));
            Need(failure.Code == ReelCode.Unreadable && failure.Offset > 0 && failure.Size > 0, "the range that failed");
            Need(failure.InnerException.Message == "the disk is gone", "the exception of the stream");
            stream.Fails = false;
            Need(decoder.Frames<float>(0, 0, 1).Length == 3 * file.Info.VertexCount, "decoding after a failure");
        }
        Need(stream.IsDisposed, "the stream is disposed with the file");
        var kept = new Failing(bytes);
        ReelFile.Open(kept, leaveOpen: true).Dispose();
        Need(!kept.IsDisposed, "the stream is left open");
        var short_ = new Failing(bytes.Take(20).ToArray());
        Throws<ReelException>(() => ReelFile.Open(short_));
        Need(short_.IsDisposed, "the stream is disposed if opening fails");
    }

    private static void MemoryIsLimited(byte[] bytes)
    {
        ReelException failure = Throws<ReelException>(() =>
        {
            using (ReelFile file = ReelFile.Open(bytes, new ReelOptions { MemoryLimit = 5000 }))
            {
                Need(file.Triangles != null, "unreachable");
            }
        });
        Need(failure.Code == ReelCode.Limit && failure.Size > 5000, "the limit of memory");
    }

    private static void WrongArgumentsAreRefused(byte[] bytes)
    {
        using (ReelFile file = ReelFile.Open(bytes))
        using (var decoder = new ReelDecoder(file))
        {
            int n = file.Info.VertexCount;
            Throws<ArgumentException>(() => decoder.Decode(0, 0, 2, new float[6 * n - 1]));
            Throws<ArgumentException>(() => decoder.Decode(0, 0, 1, new double[3 * n]));
            Throws<ArgumentException>(() => decoder.Decode(0, 0, 1, new int[3 * n]));
            Throws<ArgumentException>(() => decoder.Decode(0, 0, 1, new WithReference[3 * n]));
            Throws<ArgumentException>(() => decoder.Decode(0, 0, 1, new bool[12 * n]));
            Throws<ArgumentException>(() => decoder.Decode(0, 0, 1, new float[4 * n], new ReelLayout { Offset = 2 }));
            Throws<ArgumentException>(() => decoder.Decode(0, 0, 1, new float[3 * n], new ReelLayout { ValueStride = 16 }));
            Throws<ArgumentOutOfRangeException>(() => decoder.Decode(0, 0, 1, new float[3 * n], new ReelLayout { Offset = -4 }));
            int integers = file.Tracks.ToList().FindIndex(track => track.Type == ReelType.Int16);
            Need(decoder.Frames<short>(integers, 0, 1).SequenceEqual((short[])decoder.Frames(integers, 0, 1)), "its own type");
            Throws<ArgumentException>(() => decoder.Frames<float>(integers, 0, 1));
            Throws<ArgumentException>(() => decoder.Frames<ushort>(integers, 0, 1));
            Throws<ArgumentOutOfRangeException>(() => decoder.Frames<float>(file.Info.TrackCount, 0, 1));
            Throws<ArgumentNullException>(() => decoder.Decode<float>(0, 0, 1, null));
            Throws<ArgumentException>(() => decoder.Normals(new float[3 * n], new float[3 * n - 3]));
            Throws<ArgumentException>(() => decoder.Normals(new int[3 * n], new int[3 * n]));
            Need(Throws<ReelException>(() => decoder.Frames<float>(0, file.Info.FrameCount, 1)).Code == ReelCode.Invalid,
                "a frame that is not there");
            Need(Throws<ReelException>(() => decoder.Frames<float>(0, -1, 1)).Code == ReelCode.Invalid, "a frame below 0");
            Throws<ArgumentOutOfRangeException>(() => file.BlockOfFrame(-1));
            Throws<ArgumentOutOfRangeException>(() => file.Block(file.Info.BlockCount));
            Throws<ArgumentOutOfRangeException>(() => file.Segment(1));
            Throws<ArgumentOutOfRangeException>(() => file.OpenSegment(-1));
            Throws<ArgumentOutOfRangeException>(() => file.Read(file.Info.SizeBytes - 1, 2));
            Need(decoder.Frames<float>(0, 0, 0).Length == 0, "no frames");
        }
        Throws<ArgumentNullException>(() => ReelFile.Open((byte[])null));
        Throws<FileNotFoundException>(() => ReelFile.Open("/nowhere.reel"));
    }

    private static void OrderOfDisposalIsFree(byte[] bytes, string segments)
    {
        ReelFile file = ReelFile.Open(bytes);
        var decoder = new ReelDecoder(file);
        file.Dispose();
        Need(decoder.Frames<float>(0, 0, 1).Length > 0, "a decoder keeps its file open");
        decoder.Dispose();
        decoder.Dispose();
        file.Dispose();
        Throws<ObjectDisposedException>(() => decoder.Frames<float>(0, 0, 1));
        Throws<ObjectDisposedException>(() => new ReelDecoder(file));
        Throws<ObjectDisposedException>(() => file.BlockOfFrame(0));

        ReelFile whole = ReelFile.Open(segments);
        ReelFile segment = whole.OpenSegment(1);
        whole.Dispose();
        using (var of = new ReelDecoder(segment))
        {
            Need(of.Frames<float>(0, 0, 1).Length > 0, "a segment keeps the source of its file open");
        }
        segment.Dispose();
    }

    private static void ThreadsShareAFile(byte[] bytes)
    {
        foreach (int threads in new[] { 1, 3 })
        {
            using (ReelFile file = ReelFile.Open(new MemoryStream(bytes), false, new ReelOptions { Threads = threads }))
            using (var shared = new ReelDecoder(file))
            {
                float[] wanted = shared.Frames<float>(0, 0, file.Info.FrameCount);
                int n = 3 * file.Info.VertexCount;
                Parallel.For(0, 40, i =>
                {
                    using (var own = new ReelDecoder(file))
                    {
                        Need(own.Frames<float>(0, 0, file.Info.FrameCount).SequenceEqual(wanted), "a decoder of a thread");
                    }
                    int frame = i % file.Info.FrameCount;
                    Need(shared.Frames<float>(0, frame, 1).SequenceEqual(wanted.Skip(n * frame).Take(n)), "a shared decoder");
                    Need(file.Surface.Attributes.Length > 0, "the surface meanwhile");
                });
            }
        }
    }

    private static void TheCollectorReleasesWhatIsForgotten(byte[] bytes)
    {
        var stream = new Failing(bytes);
        Task.Run(() => Forget(stream)).Wait(); // on a stack that is not scanned later
        for (int i = 0; i < 50 && !stream.IsDisposed; i++)
        {
            Task.Run(() => new byte[1 << 16]).Wait();
            GC.Collect();
            GC.WaitForPendingFinalizers();
        }
        Need(stream.IsDisposed, "finalizers close decoder and file");
    }

    private static void Forget(Stream stream)
    {
        new ReelDecoder(ReelFile.Open(stream)).Frames<float>(0, 0, 1);
    }

    private static void SegmentsMustBeOpened(string path)
    {
        using (ReelFile file = ReelFile.Open(path))
        {
            Need(file.Info.SegmentCount == 2 && file.Tracks.Count == 0, "two segments");
            Need(Throws<ReelException>(() => new ReelDecoder(file)).Code == ReelCode.Segments, "the code of segments");
            Need(Throws<ReelException>(() => file.Surface.ToString()).Code == ReelCode.Segments, "the code of segments");
        }
    }

    private static void FramesNeedNoManagedMemory(byte[] bytes)
    {
        using (ReelFile file = ReelFile.Open(bytes, new ReelOptions { Threads = 1 }))
        using (var decoder = new ReelDecoder(file))
        {
            float[] positions = decoder.Frames<float>(0, 0, 1), normals = new float[positions.Length];
            decoder.Normals(positions, normals);
            long before = GC.GetAllocatedBytesForCurrentThread();
            for (int i = 0; i < 1000; i++)
            {
                decoder.Decode(0, i % file.Info.FrameCount, 1, positions);
                decoder.Normals(positions, normals);
            }
            long allocated = GC.GetAllocatedBytesForCurrentThread() - before;
            Need(allocated < 10000, "frames allocate nothing; " + allocated);
        }
    }
}
