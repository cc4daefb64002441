// An example of a component that plays a .reel file in the mesh of a MeshFilter, for Unity 2019.3 and later. It was compiled
// and run with stubs of Unity's classes by Mono, never in Unity. Needs the files of integrations/csharp.
//
// Put walk.reel into Assets/StreamingAssets and set `path`, or rename it to walk.reel.bytes and assign it as `asset` (needed
// for Android). Another thread loads the next block (`loadAhead`) and opens segments; until it is done, the last frame
// stays. The first texture coordinates become mesh.uv, for which vertices at seams are split. Each label of the groups
// `material` is a submesh; faces without one are the last. x is mirrored (`mirror`), because Unity's axes are left-handed.
// Images and other tracks are not applied: read them with `ReelFile`.

using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Threading.Tasks;
using UnityEngine;
using UnityEngine.Rendering;

namespace Meshreel
{
    [RequireComponent(typeof(MeshFilter), typeof(MeshRenderer))]
    public sealed class ReelPlayer : MonoBehaviour
    {
        [Tooltip("The file as an asset: rename it to end in .reel.bytes.")]
        public TextAsset asset;
        [Tooltip("Without an asset: path of the file, absolute or in StreamingAssets.")]
        public string path = "";
        public bool playOnStart = true;
        public bool loop = true;
        [Tooltip("Below 0 it plays backwards.")]
        public float speed = 1;
        [Tooltip("Frames per second of files that do not state them.")]
        public float defaultFps = 25;
        [Tooltip("Compute normals in the library. They are smooth, also across hard edges.")]
        public bool normals = true;
        [Tooltip("Mirror x, as Unity's axes are left-handed.")]
        public bool mirror = true;
        [Tooltip("Load blocks of frames on another thread, and keep the last frame until they are there.")]
        public bool loadAhead = true;
        [Tooltip("Threads that share the work of a call; 0: one for each core.")]
        public int threads;
        [Tooltip("Largest memory of the file, and of each of two decoders, in MiB; 0: 2 GiB.")]
        public int memoryLimit;

        private ReelFile file;
        private Clip clip;
        private Task<Clip> pending;
        private Mesh mesh;

        /// <summary>Metadata of the file; null before `Open`.</summary>
        public ReelInfo Info => file?.Info;
        public bool isPlaying { get; private set; }
        /// <summary>Time in seconds since the first frame.</summary>
        public double time { get; set; }
        /// <summary>The current frame; -1 if none is shown yet.</summary>
        public int frame { get; private set; } = -1;
        public double duration => file == null ? 0 : file.Info.Times == null ? file.Info.FrameCount / Fps
            : file.Info.Times[file.Info.FrameCount - 1] - file.Info.Times[0] + 1 / Fps;
        private double Fps => file.Info.Fps > 0 ? file.Info.Fps : defaultFps;

        public void Play() => isPlaying = true;
        public void Pause() => isPlaying = false;

        /// <summary>Open the file of `asset` or `path`, and close the previous one.</summary>
        /// <exception cref="ReelException">The file is damaged.</exception>
        public void Open()
        {
            Close();
            var options = new ReelOptions { MemoryLimit = (long)memoryLimit << 20 };
            if (threads > 0)
            {
                options.Threads = threads;
            }
            file = asset != null ? ReelFile.Open(asset.bytes, options)
                : ReelFile.Open(Path.Combine(Application.streamingAssetsPath, path), options);
            mesh = new Mesh { name = file.Info.Name };
            mesh.MarkDynamic();
            GetComponent<MeshFilter>().mesh = mesh;
            time = 0;
        }

        public void Close()
        {
            // A task may still use the file; its handle is closed afterwards.
            pending?.ContinueWith(task => (task.Exception == null ? task.Result : null)?.Dispose());
            pending = null;
            clip?.Dispose();
            file?.Dispose();
            clip = null;
            file = null;
            frame = -1;
            if (mesh != null)
            {
                Destroy(mesh);
                mesh = null;
            }
        }

        private void Start()
        {
            Open();
            isPlaying = playOnStart;
        }

        private void OnDestroy() => Close();

        private void Update()
        {
            if (file == null || file.Info.FrameCount == 0)
            {
                return;
            }
            if (isPlaying && frame >= 0)
            {
                Advance(Time.deltaTime * speed);
            }
            try
            {
                int wanted = file.Info.Times != null ? file.FrameAt(file.Info.Times[0] + time)
                    : (int)(time * Fps + 1e-6); // tolerance for a `time` that was computed as frame / Fps
                Show(Math.Max(0, Math.Min(wanted, file.Info.FrameCount - 1)));
            }
            catch (ReelException)
            {
                Close(); // otherwise the error would repeat at each frame
                throw;
            }
        }

        private void Advance(double seconds)
        {
            time += seconds;
            if (time >= 0 && time < duration)
            {
                return;
            }
            if (loop)
            {
                time -= Math.Floor(time / duration) * duration;
            }
            else
            {
                time = Math.Max(0, Math.Min(time, duration));
                isPlaying = false;
            }
        }

        /// <summary>Show a frame, unless it is current or its block is not loaded yet.</summary>
        private void Show(int wanted)
        {
            if (wanted == frame || !IsLoaded(wanted))
            {
                return;
            }
            clip.Decode(wanted, normals);
            mesh.vertices = clip.Positions;
            if (normals)
            {
                mesh.normals = clip.Normals;
            }
            frame = wanted;
            int next = clip.After(wanted, speed < 0);
            int count = file.Info.FrameCount;
            if (loadAhead && pending == null && (loop || next >= 0 && next < count))
            {
                next = (next + count) % count;
                if (!clip.Holds(next))
                {
                    pending = Prepare(next);
                }
            }
        }

        private bool IsLoaded(int wanted)
        {
            if (clip != null && clip.Holds(wanted))
            {
                return true;
            }
            if (pending == null)
            {
                pending = Prepare(wanted);
            }
            if (loadAhead && !pending.IsCompleted)
            {
                return false;
            }
            Clip made;
            try
            {
                made = pending.GetAwaiter().GetResult(); // blocks if `loadAhead` is off; rethrows exceptions of the task
            }
            finally
            {
                pending = null;
            }
            if (made == clip)
            {
                clip.Swap();
            }
            else
            {
                clip?.Dispose();
                clip = made;
                clip.Build(mesh);
            }
            return clip.Holds(wanted) || IsLoaded(wanted); // the requested frame may have changed meanwhile
        }

        /// <summary>Load the block of a frame with the spare decoder, or open its segment.</summary>
        private Task<Clip> Prepare(int wanted)
        {
            ReelFile from = file;
            Clip current = clip;
            bool mirrored = mirror;
            int segment = from.SegmentOfFrame(wanted);
            Func<Clip> prepare = () =>
            {
                if (current == null || current.Segment != segment)
                {
                    return new Clip(from, segment, wanted, mirrored);
                }
                current.LoadSpare(wanted);
                return current;
            };
            if (loadAhead)
            {
                return Task.Run(prepare);
            }
            var done = new TaskCompletionSource<Clip>();
            done.SetResult(prepare());
            return done.Task;
        }

        /// <summary>An open segment with two decoders: one for the current block, one to load the next.</summary>
        private sealed class Clip : IDisposable
        {
            private readonly ReelFile file;
            private readonly ReelSegment frames;
            private readonly bool mirrored;
            private ReelDecoder decoder, spare;
            private int block = -1, spareBlock = -1;
            private readonly Vector3[] positions, normals; // per vertex of the file
            private readonly int[] sources; // vertex of the file per vertex of the mesh; null: identical
            private readonly Vector2[] uvs;
            private readonly int[][] submeshes;

            internal readonly int Segment;
            internal Vector3[] Positions { get; }
            internal Vector3[] Normals { get; }

            internal Clip(ReelFile whole, int segment, int frame, bool mirrored)
            {
                Segment = segment;
                this.mirrored = mirrored;
                frames = whole.Segment(segment);
                file = whole.OpenSegment(segment);
                try
                {
                    decoder = new ReelDecoder(file);
                    spare = new ReelDecoder(file);
                    LoadSpare(frame);
                    Swap();
                    positions = new Vector3[file.Info.VertexCount];
                    normals = new Vector3[positions.Length];
                    int[] corners = (int[])file.Triangles.Clone();
                    ReelAttribute uv = file.Surface.Attributes.FirstOrDefault(
                        one => one.Kind == ReelAttributeKind.Uv && one.Width == 2);
                    if (uv != null && uv.Domain != ReelDomain.Vertices)
                    {
                        sources = Split(corners, uv, out uvs);
                    }
                    else if (uv != null)
                    {
                        uvs = Enumerable.Range(0, positions.Length).Select(i => Uv(uv, i)).ToArray();
                    }
                    submeshes = Submeshes(corners);
                    Positions = sources == null ? positions : new Vector3[sources.Length];
                    Normals = sources == null ? normals : new Vector3[sources.Length];
                }
                catch
                {
                    Dispose();
                    throw;
                }
            }

            public void Dispose()
            {
                decoder?.Dispose();
                spare?.Dispose();
                file.Dispose();
            }

            internal bool Holds(int frame) => IsHere(frame) && file.BlockOfFrame(frame - frames.FirstFrame) == block;

            /// <summary>First frame, counted in the whole file, that is played after the block of a frame.</summary>
            internal int After(int frame, bool backwards)
            {
                ReelBlock now = file.Block(file.BlockOfFrame(frame - frames.FirstFrame));
                return frames.FirstFrame + now.FirstFrame + (backwards ? -1 : now.FrameCount);
            }

            internal void LoadSpare(int frame)
            {
                spareBlock = file.BlockOfFrame(frame - frames.FirstFrame);
                spare.Load(0, spareBlock);
            }

            internal void Swap()
            {
                ReelDecoder shown = decoder;
                decoder = spare;
                spare = shown;
                block = spareBlock;
            }

            internal void Build(Mesh mesh)
            {
                mesh.Clear();
                mesh.indexFormat = Positions.Length > ushort.MaxValue ? IndexFormat.UInt32 : IndexFormat.UInt16;
                mesh.vertices = Positions;
                if (uvs != null)
                {
                    mesh.uv = uvs;
                }
                mesh.subMeshCount = submeshes.Length;
                for (int i = 0; i < submeshes.Length; i++)
                {
                    mesh.SetTriangles(submeshes[i], i, false);
                }
                double[] at = file.Info.Center;
                var size = (float)file.Info.Diagonal; // diagonal of the bounding box of all frames
                var center = new Vector3((float)(mirrored ? -at[0] : at[0]), (float)at[1], (float)at[2]);
                mesh.bounds = new Bounds(center, new Vector3(size, size, size));
            }

            internal void Decode(int frame, bool withNormals)
            {
                decoder.Decode(0, frame - frames.FirstFrame, 1, positions, new ReelLayout { Type = ReelType.Float32 });
                if (withNormals)
                {
                    decoder.Normals(positions, normals);
                    Place(normals, Normals);
                }
                Place(positions, Positions);
            }

            private bool IsHere(int frame) => frame >= frames.FirstFrame && frame < frames.FirstFrame + frames.FrameCount;

            private void Place(Vector3[] from, Vector3[] to)
            {
                for (int i = 0; i < to.Length; i++)
                {
                    Vector3 one = from[sources == null ? i : sources[i]];
                    one.x = mirrored ? -one.x : one.x;
                    to[i] = one;
                }
            }

            private static Vector2 Uv(ReelAttribute uv, int item) => new Vector2((float)uv.At(item, 0), (float)uv.At(item, 1));

            /// <summary>Create a Unity vertex for each combination of vertex and UV, since Unity meshes have one
            /// UV per vertex.</summary>
            private int[] Split(int[] corners, ReelAttribute uv, out Vector2[] coordinates)
            {
                var numbers = new Dictionary<long, int>();
                var vertices = new List<int>();
                var found = new List<Vector2>();
                int[] cornerOf = file.Surface.TriangleCorners;
                EachTriangle((triangle, face) =>
                {
                    for (int k = 0; k < 3; k++)
                    {
                        int at = 3 * triangle + k;
                        int item = uv.Domain == ReelDomain.Faces ? face : cornerOf == null ? at : cornerOf[at];
                        int vertex = corners[at];
                        long key = (long)vertex << 32 | (uint)(uv.Rows == null ? item : uv.Rows[item]);
                        if (!numbers.TryGetValue(key, out int number))
                        {
                            number = numbers[key] = vertices.Count;
                            vertices.Add(vertex);
                            found.Add(Uv(uv, item));
                        }
                        corners[3 * triangle + k] = number;
                    }
                });
                coordinates = found.ToArray();
                return vertices.ToArray();
            }

            /// <summary>Triangles of each material, in the order of labels; faces without one come last.</summary>
            private int[][] Submeshes(int[] corners)
            {
                ReelGroups groups = file.Surface.Groups.FirstOrDefault(one => one.Name == "material");
                int count = groups == null ? 0 : groups.Labels.Length;
                List<int>[] lists = Enumerable.Range(0, count + 1).Select(_ => new List<int>()).ToArray();
                EachTriangle((triangle, face) =>
                {
                    int label = groups == null || groups.OfFaces[face] < 0 ? count : groups.OfFaces[face];
                    int at = 3 * triangle;
                    lists[label].Add(corners[at]);
                    lists[label].Add(corners[at + (mirrored ? 2 : 1)]); // front faces are clockwise in Unity
                    lists[label].Add(corners[at + (mirrored ? 1 : 2)]);
                });
                return lists.Take(count > 0 && lists[count].Count == 0 ? count : count + 1)
                    .Select(list => list.ToArray()).ToArray();
            }

            /// <summary>Call with the index of each triangle and of its face.</summary>
            private void EachTriangle(Action<int, int> act)
            {
                int[] sizes = file.Surface.FaceSizes;
                int triangle = 0;
                for (int face = 0; face < file.Info.FaceCount; face++)
                {
                    int end = triangle + (sizes == null ? 1 : sizes[face] - 2);
                    while (triangle < end)
                    {
                        act(triangle++, face);
                    }
                }
            }
        }
    }
}
